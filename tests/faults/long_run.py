#!/usr/bin/python3
"""Many frames in one process: memory stays as it is after the first ones, no descriptor stays open,
and the bytes are those of processes of one frame each. Surfaces of a film start from the one before:
their bytes are those of a process for every chunk of frames.

    tests/faults/long_run.py --program build/release/pencilscan --out /var/tmp/long [--frames 500]
"""

import argparse
import os
import shutil
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from scene import Scene

from files import sums

CHUNK = 50  # frames that reconstruct's shards hold together
WHAT = {"points": ["--no-mesh"], "meshes": ["--independent"], "film": []}
MOTION = 12  # frames of the moving ball, which are seen over and over
FIRST = 0.1  # of the frames, in which what is kept for the next ones grows to its size
GROWTH = 0.05


def resident_and_open(pid):
    """Resident memory, MB, and open descriptors; nothing when the process has ended."""
    try:
        with open(f"/proc/{pid}/status") as f:
            kilobytes = next(int(line.split()[1]) for line in f if line.startswith("VmRSS"))
        return kilobytes / 1024, len(os.listdir(f"/proc/{pid}/fd"))
    except (OSError, StopIteration):
        return None


def upper_quartile(values):
    return sorted(values)[len(values) * 3 // 4]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", required=True)
    parser.add_argument("--out", required=True, help="a folder for what is tried, emptied first")
    parser.add_argument("--frames", type=int, default=500)
    parser.add_argument("--alone", type=int, default=20, help="frames made by a process of their own")
    parser.add_argument("--made", choices=WHAT, default="points",
                        help="meshes: each from its frame alone; film: from the one before, too")
    args = parser.parse_args()
    scene = Scene(args.program, os.path.abspath(args.out), small=True)
    at = scene.at
    scene.do("simulate", "--rig", f"{scene.inputs}/rig.json", "--mesh", f"{scene.inputs}/ball.obj",
             "--noise", "low", "--frame-count", str(MOTION), "--translate-mm", "1", "0", "0",
             "--samples", "1", "--out", at("moving"))
    for k in range(args.frames):
        shutil.copytree(at(f"moving/frames/{k % MOTION:06d}"), at(f"frames/{k:06d}"),
                        copy_function=os.link)

    def command(frames, out):
        return ["reconstruct", "--rig", at("moving/rig.json"), "--frames", frames, "--out", out,
                "--no-pictures", *WHAT[args.made]]

    process, logs, began = scene.start(command(at("frames"), at("out")))
    samples = []  # (frames that are done, MB, descriptors)
    while process.poll() is None:
        now = resident_and_open(process.pid)
        done = sum(name.isdigit() for name in os.listdir(at("out"))) if os.path.exists(
            at("out")) else 0
        if now and done:
            samples.append((done, *now))
        time.sleep(0.05)
    ended = scene.wait(process, logs, began).succeeded()

    settled = [s for s in samples if s[0] >= FIRST * args.frames]
    half = len(settled) // 2
    early, late = (upper_quartile([s[1] for s in part]) for part in (settled[:half], settled[half:]))
    descriptors = [max(s[2] for s in part) for part in (settled[:half], settled[half:])]
    if args.made == "film":
        shards = -(-args.frames // CHUNK)
        for k in range(shards):
            scene.do(*command(at("frames"), at("parts")), "--shard", f"{k}/{shards}")
        compared, parts = range(args.frames), "parts"
    else:
        compared, parts = range(0, args.frames, max(1, args.frames // args.alone)), "alone"
        for k in compared:
            shutil.copytree(at(f"frames/{k:06d}"), scene.new("one") + f"/{k:06d}", copy_function=os.link)
            scene.do(*command(at("one"), at("alone")), "--overwrite")
    different = [k for k in compared if sums(at(f"{parts}/{k:06d}")) != sums(at(f"out/{k:06d}"))]

    print(f"{args.frames} frames in {ended.seconds:.0f} s, {len(samples)} looks at the process")
    print(f"resident memory: {samples[0][1]:.0f} MB after the first frame, {early:.0f} MB (upper "
          f"quartile) from frame {settled[0][0]} to {settled[half][0]}, {late:.0f} MB from there on; "
          f"at most {max(s[1] for s in samples):.0f} MB")
    print(f"descriptors: at most {descriptors[0]} in the first half, {descriptors[1]} in the second")
    print(f"bytes: {len(compared) - len(different)} of {len(compared)} frames as processes of their own "
          "make them")
    shutil.rmtree(args.out)
    if late > (1 + GROWTH) * early or descriptors[1] > descriptors[0] or different:
        sys.exit(f"it grows, or differs in {different}")


if __name__ == "__main__":
    main()
