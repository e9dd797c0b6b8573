#!/usr/bin/python3
"""A film: 300 frames of a bunny that bends and turns beside a ball at rest, six cameras of 640x480.

Made in one process, and again by two processes that are killed (kill -9) at five random moments and
started anew: every file is compared. Some frames are made alone, too: their figures and time beside the
film's. In a second film one camera is turned by half a pixel from the middle on: is it named, when, and
is anything else?
"""

import hashlib
import json
import math
import os
import shutil
import subprocess
import sys
import time

import numpy as np

import common
import shapes
import sweeps

sys.path.insert(0, str(common.ROOT / "benchmarks"))
import flicker

FIGURES = ["label_error", "line_recall", "distance_median_mm", "distance_p90_mm", "completeness_1mm"]
BALL = (np.array([20.0, 88.0, -50.0]), 24.0)
BUMPED = 2       # camera
KILLS = 5
FINISHED = ("sequence.csv", "sequence.json", "timing.json")  # hold times


def moment(frame):
    """Mesh of one frame, mm: the bunny turned by a degree a frame, bent to and fro over 60 frames."""
    vertices, triangles = sweeps.bunny(95)
    phase = 2 * math.pi * frame / 60
    vertices[:, 0] += 0.0008 * vertices[:, 2] ** 2 * math.sin(phase)
    a = math.radians(frame)
    turn = np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
    vertices = vertices @ turn.T + [0, -40, 6 * math.sin(2 * phase)]
    center, radius = BALL
    ball = shapes.capsule(center - [0, 0, 0.01], center + [0, 0, 0.01], radius, around=64, cap=24)
    return shapes.joined([(vertices, triangles), ball])


def bumped(rig, camera):
    """The rig with this camera alone, turned by half a pixel about its own vertical."""
    result = json.loads(json.dumps(rig))
    c = result["cameras"][camera]
    turn = common._rotation(np.array([0, 0.5 / c["K"][0][0], 0]))
    c["R"], c["t"] = (turn @ np.asarray(c["R"])).tolist(), (turn @ np.asarray(c["t"])).tolist()
    result["cameras"] = [c]
    return result


def render(args, program):
    """The frames of both films and the truth of each, where they are not there yet."""
    rig = args.out / "rig.json"
    ring = common.SMALL_RING if args.small else [
        "--camera-width", 640, "--camera-height", 480, "--camera-focal-px", 1150, "--pitch-px", 12,
        "--volume-radius-mm", 140]
    program("rig", "ring", "--overwrite", "--out", rig, *ring)
    full = json.loads(rig.read_text())
    camera = min(BUMPED, len(full["cameras"]) - 1)
    name = full["cameras"][camera]["name"]
    turned = common.write_rig(args.out / "turned.json", bumped(full, camera))
    for frame in range(args.frames):
        folder = args.out / f"frames/{frame:06d}"
        other = args.out / f"bumped/{frame:06d}"
        if other.exists():
            continue
        mesh, scene = args.out / "work/m.ply", args.out / "work/scene"
        common.write_ply(mesh, *moment(frame))
        sensor = ["--noise", "medium", "--samples", 2, "--seed", 1000 + frame, "--overwrite"]
        program("simulate", "--rig", rig, "--mesh", mesh, "--out", scene, *sensor)
        for target in (folder, other):
            shutil.rmtree(target, ignore_errors=True)
        (args.out / "truth").mkdir(exist_ok=True)
        shutil.copy(scene / "truth/mesh.ply", args.out / f"truth/{frame:06d}.ply")
        shutil.copytree(scene / "frames/000000", folder)
        shutil.copytree(folder, args.out / "work/bumped", copy_function=os.link, dirs_exist_ok=True)
        if frame >= args.frames // 2:
            program("simulate", "--rig", turned, "--mesh", mesh, "--out", scene, *sensor)
            picture = args.out / f"work/bumped/{name}.png"
            picture.unlink()
            shutil.copy(scene / f"frames/000000/{name}.png", picture)
        other.parent.mkdir(exist_ok=True)
        (args.out / "work/bumped").rename(other)
        if frame % 10 == 9:
            common.progress(f"film: rendered {frame + 1} of {args.frames} frames")
    return rig, name


def sums(folder):
    """SHA-256 of every file but those that hold times."""
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
            for p in sorted(folder.rglob("*"))
            if p.is_file() and p.name not in FINISHED and not p.relative_to(folder).parts[0].startswith(".")}


def killed(command, moments):
    """Runs a command to its end; before, as often as there are moments, for so many seconds."""
    for seconds in moments:
        started = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                   start_new_session=True)
        try:
            started.wait(seconds)
            common.progress("film: ended before it was killed")
        except subprocess.TimeoutExpired:
            subprocess.run(["pkill", "-KILL", "-s", str(started.pid)])
            started.wait()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def ball_alone(mesh):
    """Of a mesh as flicker.read_mesh() has it, the vertices on the ball."""
    center, radius = BALL
    on = np.abs(np.linalg.norm(mesh[0] - center, axis=1) - radius) < 2
    return tuple(part[on] for part in mesh)


def evaluated(args, program, rig, frame, result):
    return program("evaluate", "--truth", args.out / f"truth/{frame:06d}.ply", "--rig", rig, "--result", result)


def events(program, result):
    """What `sequence finish` says has changed, and how many single frames it calls odd."""
    figures = program("sequence", "finish", "--out", result)
    changes = json.loads((result / "sequence.json").read_text())["events"]
    return {"changes": changes, "odd": figures["odd_frames"]}


def run(args):
    program = common.Program(args)
    rig, camera = render(args, program)
    rows = common.Rows(args.out / "results.csv", ["frame"],
                       [*FIGURES, *("alone_" + f for f in FIGURES), "alone_seconds", "flicker"])
    about = {"frames": args.frames}

    def timed(*words):
        start = time.monotonic()
        program(*words)
        return time.monotonic() - start

    reconstruct = ["reconstruct", "--rig", rig, "--no-pictures", "--overwrite"]
    whole = args.out / "whole"
    about["seconds"] = timed(*reconstruct, "--frames", args.out / "frames", "--out", whole)
    common.progress(f"film: {args.frames} frames in {about['seconds']:.0f} s")

    random = np.random.default_rng(1)
    again = args.out / "killed"
    shutil.rmtree(again, ignore_errors=True)
    shutil.rmtree(f"{again}.job", ignore_errors=True)
    command = [str(program.path), "sequence", "submit", "--local", "2", "--rig", str(rig), "--frames",
               str(args.out / "frames"), "--out", str(again), "--no-pictures"]
    moments = [round(float(m), 2) for m in random.uniform(0.02, 0.12, KILLS) * about["seconds"]]
    killed(command, moments)
    one, other = sums(whole), sums(again)
    about["killed"] = {"after_seconds": moments, "files": len(one),
                       "differing": sorted(f for f in {*one, *other} if one.get(f) != other.get(f))[:20]}
    common.progress(f"film: killed {KILLS} times, {len(about['killed']['differing'])} files differ")

    about["events"] = events(program, whole)
    watched = args.out / "watched"
    program(*reconstruct, "--no-mesh", "--frames", args.out / "bumped", "--out", watched)
    about["bumped"] = {"camera": camera, "frame": args.frames // 2,
                       "events": events(program, watched)}

    step = max(1, args.frames // 15)
    for frame in range(step - 1, args.frames, step):
        work = args.out / "work"
        shutil.rmtree(work / "one", ignore_errors=True)
        shutil.copytree(args.out / f"frames/{frame:06d}", work / f"one/{frame:06d}")
        seconds = timed(*reconstruct, "--frames", work / "one", "--out", work / "alone")
        film = evaluated(args, program, rig, frame, whole / f"{frame:06d}")
        alone = evaluated(args, program, rig, frame, work / f"alone/{frame:06d}")
        change = None
        if frame + 1 < args.frames:
            two = [ball_alone(flicker.read_mesh(whole / f"{f:06d}/mesh.ply")) for f in (frame, frame + 1)]
            change = flicker.root_mean_square(flicker.changes(*two))
        rows.add(frame=frame, alone_seconds=seconds, flicker=change, **{k: film.get(k) for k in FIGURES},
                 **{"alone_" + k: alone.get(k) for k in FIGURES})
    (args.out / "film.json").write_text(json.dumps(about, indent=1) + "\n")
    return rows, about


def report(args, rows, about):
    table = [[k, common.spread(rows.column(k), 4), common.spread(rows.column("alone_" + k), 4)]
             for k in FIGURES]
    table.append(["seconds a frame", common.number(about["seconds"] / about["frames"], 2),
                  common.spread(rows.column("alone_seconds"), 2)])
    table.append(["flicker of the ball, sigma", common.spread(rows.column("flicker"), 2), "-"])
    common.print_table(args.out / "table.md", f"{about['frames']} frames; median (quartiles) of {len(rows.rows)}",
                       ["", "film", "alone"], table)
    print(f"killed after {about['killed']['after_seconds']} s: {len(about['killed']['differing'])} of "
          f"{about['killed']['files']} files differ\nevents: {about['events']}\nbumped: {about['bumped']}")


if __name__ == "__main__":
    arguments = common.arguments("film", __doc__, frames=(300, 4))
    report(arguments, *run(arguments))
