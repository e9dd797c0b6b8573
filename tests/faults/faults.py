#!/usr/bin/python3
"""What the program does when something goes wrong around it: it is killed, the disk is full or
read-only, memory lacks, files are cut or change under its hands, clocks jump, cameras fail.

Each try must end in a right result, with a warning where it is worth less than it seems, or in a clear
complaint that names the file; nothing half-written stays, and the same command once more makes what an
undisturbed run makes. Prints a table; exit code 1 where a rule is broken.

    tests/faults/faults.py --program build/release/pencilscan --out /var/tmp/faults [--small]
"""

import argparse
import collections
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from scene import HEIGHT, WIDTH, Scene
from whole import Broken, check_whole

from files import read_png, sums, turn_camera, write_png, write_tiff

MARK = "PENCILSCAN_FAULTS_NAMESPACE"  # set in a process that may mount what nobody else sees


class Skipped(Exception):
    """This machine does not let the fault be made."""


def enter_namespace():
    """Starts this script anew where it may mount small and read-only disks, if it can."""
    if MARK in os.environ:
        return
    for options in (["-m"], ["-rm"]):
        if subprocess.run(["unshare", *options, "mount", "-t", "tmpfs", "tmpfs", "/mnt"],
                          capture_output=True).returncode == 0:
            os.environ[MARK] = "yes"
            os.execvp("unshare", ["unshare", *options, sys.executable, *sys.argv])


class Disk:
    """A disk of a size of its own below the scene's folder."""

    def __init__(self, scene):
        if MARK not in os.environ:
            raise Skipped("no mounts here")
        self.path = scene.at("disk")
        os.makedirs(self.path, exist_ok=True)
        self.mount("-t", "tmpfs", "-o", "size=1G", "tmpfs")

    def mount(self, *arguments):
        self.call("mount", *arguments, self.path)

    @staticmethod
    def call(*words):
        """Waits for killed processes, which keep their files open a little longer."""
        for _ in range(50):
            done = subprocess.run(words, capture_output=True, text=True)
            if "busy" not in done.stderr:
                break
            time.sleep(0.1)
        if done.returncode != 0:
            raise RuntimeError(done.stderr)

    def limit_to(self, size):
        self.mount("-o", f"remount,size={size}")

    def used(self):
        disk = os.statvfs(self.path)
        return (disk.f_blocks - disk.f_bfree) * disk.f_frsize

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.call("umount", self.path)


# ---- faults: each tries once and says in a word how it ended ---------------------------------------


def killed(scene, command, rng):
    out = command.prepare(scene.new("out"))
    process, logs, _ = command.start(out)
    time.sleep(rng.uniform(0, 1.1 * command.seconds))
    scene.kill_all(process, logs)
    if os.path.exists(out):
        check_whole(out, False)
    command.go_on(out)
    return "right when run again"


def disk_full(scene, command, rng):
    with Disk(scene) as disk:
        out = command.prepare(f"{disk.path}/out")
        disk.limit_to(disk.used() + 8192 + int(command.bytes * rng.uniform(0, 1.05)))
        done = command.run(out)
        if done.code != 0:
            done.complaint()
            if "No space left on device" not in done.error:
                raise Broken(f"says of a full disk: {done.lines[-1]!r}")
        check_whole(out, True)
        disk.limit_to(2**30)
        command.go_on(out)
    return "right" if done.code == 0 else "says it; right with space"


def file_too_large(scene, command, rng):
    out = command.prepare(scene.new("out"))
    limit = int(2 ** rng.uniform(12, 22))  # what the command says is a file, too
    done = command.run(out, limits=[(resource.RLIMIT_FSIZE, limit)])
    if done.code != 0:
        done.complaint()
        if "File too large" not in done.error:
            raise Broken(f"says of files of at most {limit} bytes: {done.lines[-1]!r}")
    check_whole(out, True) if os.path.exists(out) else None
    command.go_on(out)
    return "right" if done.code == 0 else "says it; right without limit"


def read_only(scene, command, rng):
    with Disk(scene) as disk:
        out = command.prepare(f"{disk.path}/out")
        if rng.random() < 0.5:  # half a result
            process, logs, _ = command.start(out)
            time.sleep(rng.uniform(0, command.seconds))
            scene.kill_all(process, logs)
        before = sums(disk.path)
        disk.mount("-o", "remount,ro")
        done = command.run(out, more=command.again(out))
        if done.code != 0:
            done.complaint("Read-only file system", "out")
        if sums(disk.path) != before:
            raise Broken("a read-only disk changed")
        if done.code == 0:
            command.is_right(out)
        disk.mount("-o", "remount,rw")
        command.go_on(out)
    return "right, was done" if done.code == 0 else "says it; right when writable"


def no_temporary_folder(scene, command, rng):
    places = [p for p in ("/tmp", "/var/tmp") if os.path.isdir(p)]
    needed = (scene.folder, scene.program)
    if MARK not in os.environ or any(n.startswith(p + "/") for n in needed for p in places):
        raise Skipped("no mounts here, or --out or the program is in /tmp")
    for place in places:
        subprocess.run(["mount", "-t", "tmpfs", "-o", "ro", "tmpfs", place], check=True)
    try:
        out = command.prepare(scene.new("out"))
        command.run(out, environment={"TMPDIR": "/nowhere"}).succeeded()
        command.is_right(out)
    finally:
        for place in places:
            subprocess.run(["umount", place], check=True)
    return "right"


def little_memory(scene, command, rng):
    out = command.prepare(scene.new("out"))
    megabytes = int(2 ** rng.uniform(8.3, 10.2))  # the interesting ones: 315 to 1176
    limits = [(resource.RLIMIT_AS, megabytes << 20)]
    done = command.run(out, limits=limits)
    if done.code in (127, -signal.SIGABRT) and not scene.starts(limits):
        return "the libraries do not start"
    if done.code != 0:
        done.complaint()
        if "memory" not in done.error:
            raise Broken(f"says of {megabytes} MB: {done.lines[-1]!r}")
    if os.path.exists(out):
        check_whole(out, True)
    command.go_on(out)
    return "right" if done.code == 0 else "says it; right with memory"


#: What each command reads: (of the inputs, a picture in another format).
INPUTS = {
    "reconstruct": ["rig.json", "frames/000001/cam1.png", "tiff", "jpg"],
    "calibrate": ["rig.json", "captures/proj0/cam0/003.png"],
    "simulate": ["rig.json", "ball.obj"],
    "sequence submit": ["rig.json", "many/000001/cam1.png"],
    "sequence finish": ["result/inputs.json", "result/devices.json", "result/000001/report.json",
                        "result/000001/input.json"],
    "sequence export": ["result/inputs.json", "result/000001/mesh.ply"],
}


def other_format(scene, inputs, ending):
    """A picture as a file of another format instead of its PNG."""
    picture = f"{inputs}/frames/000001/cam1"
    if ending == "tiff":
        write_tiff(picture + ".tiff", read_png(picture + ".png"), 1)
    else:
        scene.do("simulate", "--rig", f"{inputs}/rig.json", "--mesh", f"{inputs}/ball.obj",
                 "--samples", "1", "--jpeg", "92", "--out", scene.new("jpeg"))
        shutil.copy(scene.at("jpeg/frames/000000/cam1.jpg"), picture + ".jpg")
    os.remove(picture + ".png")
    return f"frames/000001/cam1.{ending}"


def truncated(scene, command, rng):
    inputs = scene.copied_inputs()
    name = rng.choice(INPUTS[command.name])
    if name in ("tiff", "jpg"):
        name = other_format(scene, inputs, name)
    with open(f"{inputs}/{name}", "rb") as f:
        data = f.read()
    os.remove(f"{inputs}/{name}")
    with open(f"{inputs}/{name}", "wb") as f:
        f.write(data[:rng.randrange(len(data))])
    out = command.prepare(scene.new("out"), inputs)
    done = command.run(out, inputs)
    if os.path.exists(out) and not command.result:  # which got it in its folder
        check_whole(out, True)
    said = os.path.basename(name) in done.error or (
        os.path.basename(os.path.dirname(name)) in done.error)
    if done.code != 0:
        done.complaint()
        if not said:
            raise Broken(f"does not name {name} cut short: {done.lines[-1]!r}")
        return "names the file"
    if said:
        return "warns of the file"
    found = sums(out)
    if found != command.expected and not name.endswith((".json", ".obj")):
        raise Broken(f"takes {name} cut short for whole")
    if found != command.expected:
        raise Broken(f"another result, and not a word of {name} cut short")
    return "right"


def changing(scene, command, rng):
    """A picture becomes that of another frame during the run, at once or while it is written."""
    inputs = scene.copied_inputs()
    frame = rng.randrange(3)
    picture = f"{inputs}/frames/{frame:06d}/{rng.choice(scene.cameras)}.png"
    with open(picture.replace(f"/{frame:06d}/", f"/{(frame + 1) % 3:06d}/"), "rb") as f:
        data = f.read()
    at_once = rng.random() < 0.5
    out = scene.new("out")
    started = command.start(out, inputs)
    time.sleep(rng.uniform(0, command.seconds))
    if at_once:
        with open(scene.at("new.png"), "wb") as f:
            f.write(data)
        os.replace(scene.at("new.png"), picture)
    else:
        os.remove(picture)
        with open(picture, "wb") as f:
            f.write(data[:len(data) // 2])
            f.flush()
            time.sleep(rng.uniform(0, 0.3))
            f.write(data[len(data) // 2:])
    done = scene.wait(*started)
    after = scene.new("after")
    command.run(after, inputs).succeeded()  # of what is there now
    before = scene.at(f"undisturbed/{command.name}")
    if os.path.exists(out):
        check_whole(out, True)
    for name in sorted(os.listdir(before)):
        if not name.isdigit() or not os.path.exists(f"{out}/{name}/report.json"):
            continue
        if sums(f"{out}/{name}") not in (sums(f"{before}/{name}"), sums(f"{after}/{name}")):
            raise Broken(f"frame {name} is neither of the old nor of the new pictures")
    if done.code != 0:
        done.complaint()
        if f"{frame:06d}" not in done.error:
            raise Broken(f"does not name the changing frame: {done.lines[-1]!r}")
        return "names the frame"
    return "right, of the old or the new picture"


SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>
/* Every look at the clock of the day is up to a year off, ahead or behind. */
static long jump(void) { return rand() % 63072000 - 31536000; }
int clock_gettime(clockid_t id, struct timespec* t) {
  static int (*real)(clockid_t, struct timespec*);
  if (!real) real = (int (*)(clockid_t, struct timespec*))dlsym(RTLD_NEXT, "clock_gettime");
  int result = real(id, t);
  if (id == CLOCK_REALTIME || id == CLOCK_REALTIME_COARSE) t->tv_sec += jump();
  return result;
}
int gettimeofday(struct timeval* t, void* zone) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  t->tv_sec = now.tv_sec, t->tv_usec = now.tv_nsec / 1000;
  return 0;
}
time_t time(time_t* t) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (t) *t = now.tv_sec;
  return now.tv_sec;
}
"""


def clock_jumps(scene, command, rng):
    """The clock of the day, and files of the future and of 1970."""
    library = scene.at("jump.so")
    if not os.path.exists(library):
        if shutil.which("cc") is None:
            raise Skipped("no C compiler")
        with open(scene.at("jump.c"), "w") as f:
            f.write(SHIM)
        subprocess.run(["cc", "-shared", "-fPIC", "-o", library, scene.at("jump.c"), "-ldl"],
                       check=True)
    inputs = scene.copied_inputs()
    for root, _, files in os.walk(inputs):
        for name in files:
            date = rng.choice((0, 4e9))
            os.utime(os.path.join(root, name), (date, date))
    out = command.prepare(scene.new("out"), inputs)
    command.run(out, inputs, environment={"LD_PRELOAD": library}).succeeded()
    command.is_right(out)
    return "right"


# ---- cameras and their clocks ----------------------------------------------------------------------


def evaluated(scene, out, frame):
    """Label error and median distance, mm, of the points of a frame, by the rig that took it."""
    if not os.path.exists(f"{out}/{frame}/points.ply"):
        raise Broken(f"{frame} has no points")
    scene.do("evaluate", "--truth", f"{scene.inputs}/truth/{frame}/mesh.ply", "--rig",
             f"{scene.inputs}/rig.json", "--result", f"{out}/{frame}/points.ply", "--json",
             scene.at("figures.json"))
    with open(scene.at("figures.json")) as f:
        figures = json.load(f)
    return figures["label_error"], figures["distance_median_mm"]


def camera_fault(spoil, is_right=None):
    """`spoil(inputs, camera, other, rng)` makes the fault of a camera in all frames; the warning names
    the camera. `is_right`: whether the points must be as good as without the fault; None: nobody
    looks."""
    def fault(scene, command, rng):
        inputs = scene.copied_inputs()
        camera, other = rng.sample(scene.cameras, 2)
        spoil(inputs, camera, other, rng)
        out = scene.new("out")
        done = command.run(out, inputs)
        if done.code != 0:
            done.complaint(camera)
            return "names the camera's file"
        check_whole(out, True)
        named = f"camera {camera}" in done.error or f" {camera} " in done.error
        if not named and not is_right:
            raise Broken(f"{camera} is not named: {done.lines[-3:]}")
        end = "warns of the camera"
        if is_right is not None:
            for frame in sorted(os.listdir(f"{inputs}/frames")):
                wrong, distance = evaluated(scene, out, frame)
                _, usual = evaluated(scene, f"{scene.folder}/undisturbed/reconstruct",
                                     frame)
                if wrong <= 0.02 and distance <= 2 * usual:
                    continue
                found = f"{frame}: {100 * wrong:.1f} % wrong labels, {distance:.2f} mm"
                with open(f"{out}/{frame}/report.json") as f:
                    findings = {finding["code"] for finding in json.load(f).get("findings", [])}
                if is_right and "views-disagree" not in findings:
                    raise Broken(found)
                of_what = "that views disagree" if is_right else "of the camera"
                return f"warns {of_what}, with wrong labels or distances"
            end = "right, warns of the camera" if named else "right without a word"
        return end
    return fault


def pictures(inputs, camera):
    folder = f"{inputs}/frames"
    return [f"{folder}/{frame}/{camera}.png" for frame in sorted(os.listdir(folder))]


def even(value):
    def spoil(inputs, camera, other, rng):
        for picture in pictures(inputs, camera):
            os.remove(picture)
            write_png(picture, [bytes([value]) * (3 * WIDTH)] * HEIGHT)
    return spoil


def swapped(inputs, camera, other, rng):
    for a, b in zip(pictures(inputs, camera), pictures(inputs, other)):
        os.rename(a, a + ".kept")
        os.rename(b, a)
        os.rename(a + ".kept", b)


def frozen(inputs, camera, other, rng):
    first, *later = pictures(inputs, camera)
    for picture in later:
        os.remove(picture)
        os.link(first, picture)


def moved(inputs, camera, other, rng):
    """The rig says that the camera looks elsewhere, by 3 to 60 px."""
    with open(f"{inputs}/rig.json") as f:
        rig = json.load(f)
    turn_camera(rig, camera, rng.uniform(3, 60) * rng.choice((-1, 1)))
    os.remove(f"{inputs}/rig.json")
    with open(f"{inputs}/rig.json", "w") as f:
        json.dump(rig, f)


def not_numbers(inputs, camera, other, rng):
    """Float pixels, of which some are no numbers."""
    picture = rng.choice(pictures(inputs, camera))
    rows = [[value / 255 for value in row] for row in read_png(picture)]
    for _ in range(rng.choice((1, 100, 10000))):
        rows[rng.randrange(HEIGHT)][rng.randrange(3 * WIDTH)] = rng.choice(
            (float("nan"), float("inf"), float("-inf")))
    os.remove(picture)
    write_tiff(picture.replace(".png", ".tiff"), rows, 4)


def time_stamps_jump(scene, command, rng):
    """The clock of one camera jumps by up to an hour. No frame of the recording mixes moments, and no
    picture is lost without a word."""
    inputs = scene.copied_inputs()
    frames = sorted(os.listdir(f"{inputs}/many"))
    camera, at = rng.choice(scene.cameras), rng.randrange(1, len(frames))
    jump = rng.choice((-1, 1)) * rng.randrange(10**9, 3600 * 10**9)
    with open(f"{inputs}/many/timestamps.csv", "w") as f:
        f.write(",".join(["frame", *scene.cameras]) + "\n")
        for k, frame in enumerate(frames):
            times = [4 * 10**12 + k * 33_333_333 + (jump if c == camera and k >= at else 0)
                     for c in scene.cameras]
            f.write(",".join([frame, *map(str, times)]) + "\n")
    out = scene.new("out")
    scene.do("sequence", "pack", "--frames", f"{inputs}/many", "--out", f"{out}/r.zarr")
    told = scene.do("sequence", "unpack", "--frames", f"{out}/r.zarr", "--out", f"{out}/again")
    moment = {}
    for k in range(3):
        for c in scene.cameras:
            with open(f"{scene.inputs}/frames/{k:06d}/{c}.png", "rb") as f:
                moment[f.read()] = k
    found = 0
    for frame in sorted(os.listdir(f"{out}/again")):
        shown = set()
        for name in os.listdir(f"{out}/again/{frame}") if frame.isdigit() else ():
            with open(f"{out}/again/{frame}/{name}", "rb") as f:
                shown.add(moment[f.read()])
                found += 1
        if len(shown) > 1:
            raise Broken(f"frame {frame} mixes moments {shown}")
    if found < len(frames) * len(scene.cameras) and camera not in told.error + told.output:
        raise Broken(f"{len(frames) * len(scene.cameras) - found} pictures lost without a word")
    return "no frame mixes moments"


# ---- the table -------------------------------------------------------------------------------------

ALL = ["reconstruct", "calibrate", "simulate", "sequence submit", "sequence finish",
       "sequence export"]
SLOW = ["reconstruct, all output"]
CAMERAS = ["reconstruct"]
#: name, what, commands and tries of each; then commands that take long and their tries
FAULTS = [
    ("killed (kill -9)", killed, ALL, 20, SLOW, 4),
    ("disk full", disk_full, ALL, 10, SLOW, 3),
    ("files may not grow", file_too_large, ALL, 8, [], 0),
    ("read-only output", read_only, ALL, 4, [], 0),
    ("no temporary folder", no_temporary_folder, ALL, 1, SLOW, 1),
    ("little memory", little_memory, ALL, 10, SLOW, 5),
    ("input cut short", truncated, ALL, 10, [], 0),
    ("picture changes during the run", changing, CAMERAS, 24, [], 0),
    ("clock jumps", clock_jumps, ALL, 2, [], 0),
    ("time stamps jump", time_stamps_jump, ["sequence pack"], 8, [], 0),
    ("pixels are no numbers", camera_fault(not_numbers), CAMERAS, 6, [], 0),
    ("camera is black", camera_fault(even(0), True), CAMERAS, 4, [], 0),
    ("camera is saturated", camera_fault(even(255), True), CAMERAS, 4, [], 0),
    ("pictures of two cameras swapped", camera_fault(swapped, True),
     ["reconstruct", "reconstruct, all output"], 6, [], 0),
    ("camera repeats its picture", camera_fault(frozen), CAMERAS, 4, [], 0),
    ("camera was moved", camera_fault(moved, False), CAMERAS, 8, [], 0),
]
#: The test of every day: name, command.
SMALL = [("killed", "reconstruct"), ("killed", "simulate"), ("killed", "calibrate"),
         ("disk full", "reconstruct"), ("files may", "simulate"), ("read-only", "calibrate"),
         ("no temporary", "reconstruct"), ("little memory", "calibrate"),
         ("input cut", "reconstruct"), ("picture changes", "reconstruct"),
         ("pixels are", "reconstruct"), ("camera is black", "reconstruct"),
         ("camera repeats", "reconstruct")]


def plan(args):
    """Name, fault, command and number of tries, of what is asked for."""
    for name, fault, commands, tries, slow, slow_tries in FAULTS:
        for command in [*commands, *slow]:
            number = args.tries or (tries if command in commands else slow_tries)
            if args.small:
                number = 1 if any(name.startswith(n) and command == c for n, c in SMALL) else 0
            if not name.startswith(args.only) or args.command not in (None, command):
                number = 0
            if number:
                yield name, fault, command, number


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", required=True)
    parser.add_argument("--out", required=True, help="a folder for what is tried, emptied first")
    parser.add_argument("--small", action="store_true", help="points alone and few tries: the test")
    parser.add_argument("--only", default="", help="faults whose name begins so")
    parser.add_argument("--command", help="of this command alone")
    parser.add_argument("--tries", type=int, help="of each, instead of its own number")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    enter_namespace()
    scene = Scene(args.program, os.path.abspath(args.out), args.small)
    tried = list(plan(args))
    commands = scene.commands({command for _, _, command, _ in tried})
    broken = 0
    print("| fault | command | tries | how they ended |\n|---|---|---|---|", flush=True)
    for name, fault, command, tries in tried:
        ends = collections.Counter()
        for k in range(tries):
            seed = f"{args.seed} {name} {command} {k}"
            try:
                ends[fault(scene, commands.get(command), random.Random(seed))] += 1
            except Skipped as reason:
                ends[f"left out: {reason}"] += 1
                break
            except Broken as reason:
                broken += 1
                ends[f"BROKEN: {reason}"] += 1
                print(f"{seed}: {reason}", file=sys.stderr)
        text = ", ".join(f"{n} {end}" for end, n in sorted(ends.items()))
        print(f"| {name} | {command} | {sum(ends.values())} | {text} |", flush=True)
    shutil.rmtree(args.out)
    if broken:
        sys.exit(f"{broken} tries broke a rule")


if __name__ == "__main__":
    main()
