#!/usr/bin/python3
"""Rigs and settings that a die chose: how results are where nobody looked before.

Two to eight cameras and projectors that stand and look askew, with lenses, mosaics, units, pitches, colours, rolls, noise and
exposures drawn at random before the objects of heldout.py. Some of the objects move within the exposure. Lengths are scaled
to a working volume of 170 mm radius.
"""

import json
import math
import shutil

import numpy as np

import common
import heldout

RADIUS = heldout.VOLUME_RADIUS
OBJECTS = ["bunny", "balls", "bent_hand", "bust", "cat", "dragon", "gyroid", "horse", "knot", "part", "rock", "vase"]
SIZES = [(640, 480), (1280, 960), (1440, 1080), (960, 1280)]
COLORS = [("blue,cyan", "red,yellow"), ("red,magenta", "green,cyan"), ("green,yellow", "blue,magenta"), ("red,green,blue",)]
MOVING = 0.3  # share of the frames
SETTINGS = ["cameras", "projectors", "object", "size", "pitch", "noise", "exposure", "mosaic", "has_lens", "unit"]
COLUMNS = ["points", "label_error", "line_recall", "distance_median_mm", "share_above_2mm", "sigma_below_1",
           "mesh_distance_median_mm", "mesh_share_above_2mm", "completeness_1mm", "way_mm", "found_way_mm",
           "accused"]


def drawn(seed):
    """What the die chose: a dict for the table, and options."""
    die = np.random.default_rng([seed, 20])
    cameras, projectors = int(die.integers(2, 9)), int(die.choice([2, 3, 4, 6, 8]))
    pitch, size = float(die.choice([8, 10, 12, 16])), SIZES[die.integers(len(SIZES))]
    is_rolled = die.random() < 0.4
    way = float(np.exp(die.uniform(math.log(0.1), math.log(1.5)))) if die.random() < MOVING else 0.0
    direction = die.normal(size=3)
    return {
        "cameras": cameras, "projectors": projectors, "object": OBJECTS[die.integers(len(OBJECTS))],
        "pitch": pitch, "line": pitch / 3 * die.uniform(0.7, 1.3), "size": size,
        "arc": 360.0 if min(cameras, projectors) >= 4 else min(360.0, 45.0 * max(cameras, projectors)),
        "colors": COLORS[die.integers(len(COLORS))], "unit": float(die.choice([1, 1, 1, 0.001, 30])),
        "lines": ["vertical"] if is_rolled else ["vertical", "horizontal"],
        "rolls": [float((-1) ** k * die.uniform(20, 45)) for k in range(projectors)] if is_rolled else [0],
        "has_lens": bool(die.random() < 0.5), "mosaic": bool(die.random() < 0.25),
        "noise": str(die.choice(["none", "low", "medium", "medium", "high"])),
        "exposure": float(die.choice([0.15, 0.3, 0.55, 0.9])),
        "way": way, "motion": way * direction / np.linalg.norm(direction)}


def askew(rig, choice, seed):
    """The rig with every device turned about the middle, nearer or farther, looking a little beside it, with another focal
    length and perhaps a lens; in another unit."""
    die = np.random.default_rng([seed, 21])
    for device in rig["cameras"] + rig["projectors"]:
        away = common._rotation(die.normal(0, math.radians(6), 3))
        aim = common._rotation(np.array([*die.normal(0, 0.012, 2), die.normal(0, 0.15)]))
        device["R"] = (aim @ np.asarray(device["R"]) @ away).tolist()
        device["t"] = (choice["unit"] * aim @ np.asarray(device["t"]) * die.uniform(0.85, 1.2)).tolist()
        focal = die.uniform(0.93, 1.05)
        device["K"][0][0] *= focal
        device["K"][1][1] *= focal * die.uniform(0.98, 1.02)
        if choice["has_lens"]:
            device["distortion"] = [die.normal(0, 0.12), die.normal(0, 0.1), *die.normal(0, 0.002, 2), 0.0]
    if choice["mosaic"]:
        for camera in rig["cameras"]:
            camera["mosaic"] = "RGGB"
    rig["volume"]["radius"] *= choice["unit"]
    rig["unit"] = "mm" if choice["unit"] == 1 else "unknown"
    return rig


def rendered(program, folder, seed):
    choice = drawn(seed)
    width, height = choice["size"]
    program("rig", "ring", "--overwrite", "--out", folder / "ring.json", "--cameras", choice["cameras"], "--projectors",
            choice["projectors"], "--arc-deg", choice["arc"], "--pitch-px", choice["pitch"], "--line-width-px", choice["line"],
            "--offset-px", choice["pitch"] / 2, "--camera-width", width, "--camera-height", height, "--camera-focal-px",
            2300 * min(width / 1280, height / 960), "--lines", *choice["lines"], "--roll-deg", *choice["rolls"],
            "--colors", *choice["colors"])
    rig = askew(json.loads((folder / "ring.json").read_text()), choice, seed)
    common.write_rig(folder / "rig.json", rig)
    common.write_ply(folder / "mesh.ply", *heldout.MAKERS[choice["object"]](seed))
    program("simulate", "--overwrite", "--rig", folder / "rig.json", "--mesh", folder / "mesh.ply", "--fit", "--out",
            folder / "scene", "--noise", choice["noise"], "--exposure", choice["exposure"], "--seed", seed,
            "--motion-mm-s", *(choice["unit"] * choice["motion"]), "--exposure-ms", 1000)
    return choice


def way_found(scene, report):
    """How far the object went, as the report has it; 0: at rest. In lengths of a volume of RADIUS."""
    rig = json.loads((scene / "rig.json").read_text())
    motion = report.get("motion", {})
    return RADIUS / rig["volume"]["radius"] * motion["way_mm"] if motion.get("seen") else 0.0


def accused(report):
    """How many cameras are said to have a wrong picture; all of them are right."""
    return sum(finding["code"] == "wrong-picture" for finding in report["findings"])


def print_summary(path, rows):
    table = []
    for key, title, sign in (("label_error", "label error, share", 1), ("line_recall", "line recall", -1),
                             ("distance_median_mm", "points: median, mm", 1),
                             ("share_above_2mm", "points beyond 2 mm, share", 1),
                             ("mesh_distance_median_mm", "surface: median, mm", 1),
                             ("mesh_share_above_2mm", "surface beyond 2 mm, share", 1),
                             ("completeness_1mm", "complete at 1 mm", -1)):
        values = np.sort([sign * float(row[key]) for row in rows if row[key] != ""])
        picked = sign * values[[len(values) // 2, len(values) * 9 // 10, -1]]
        table.append([title, *(f"{v:.4f}" for v in picked)])
    common.print_table(path, f"{len(rows)} rigs drawn at random", ["of the frames", "median", "worst of ten", "worst"], table)
    below = np.sort([float(row["sigma_below_1"]) for row in rows if row["sigma_below_1"] != ""])
    print(f"points below one sigma: {below[len(below) // 2]:.2f} ({below[0]:.2f} to {below[-1]:.2f})")
    ways = np.array([[float(row["way_mm"]), float(row["found_way_mm"])] for row in rows])
    rests, seen = ways[:, 0] == 0, ways[:, 1] > 0
    print(f"at rest: {rests.sum()}, said to move: {(rests & seen).sum()}; moving: {(~rests).sum()}, seen: {(~rests & seen).sum()}")
    for way, found in ways[~rests & seen]:
        print(f"  went {way:.2f} mm, found {found:.2f}")
    print(f"cameras said to have a wrong picture: {sum(int(row['accused']) for row in rows)} of "
          f"{sum(int(row['cameras']) for row in rows)}")


def main():
    args = common.arguments("drawn_rigs", __doc__, draws=(60, 1), first=(1, 1))
    args.reconstruct, args.keep = "", True  # of heldout.measure()
    program = common.Program(args)
    rows = common.Rows(args.out / "results.csv", ["seed"], SETTINGS + COLUMNS, args.resume)
    for seed in range(args.first, args.first + args.draws):
        if rows.has(seed=seed):
            continue
        common.progress(f"drawn_rigs: {seed}")
        folder = args.out / "work" / str(seed)
        choice = rendered(program, folder, seed)
        scene = folder / "scene"
        found = heldout.measure(args, program, scene, scene / "rig.json", scene / "frames", folder / "made")
        if not found:
            raise SystemExit(f"drawn_rigs: seed {seed} has no result: see {args.out / 'commands.log'}")
        shown = {key: choice[key] for key in SETTINGS}
        report = json.loads((folder / "made/result/000000/report.json").read_text())
        rows.add(seed=seed, **shown, **{key: found[key] for key in COLUMNS if key in found}, way_mm=choice["way"],
                 found_way_mm=way_found(scene, report), accused=accused(report))
        shutil.rmtree(folder / "made")
        print(" ".join(f"{key} {value}" for key, value in shown.items()))
    print_summary(args.out / "table.md", rows.rows)


if __name__ == "__main__":
    main()
