#!/usr/bin/python3
"""Acceptance: a ball, a ball bar and a plate in ten positions, still and moving.

The rig of `rig ring` with medium noise. Artefacts of known size are rendered in ten positions over
the working volume, at rest and moving within the exposure at 10 to 500 mm/s (a speed and a direction
for each position), with three-channel and with raw cameras. One frame each is reconstructed as a
user would, and `pencilscan artefact` measures its points, and beside them its measured mesh.
"""

import json
import math
import sys

import numpy as np

import common
import shapes

DIAMETER, BALL = 80.0, 50.0  # mm: of the ball, of the bar's two balls
LENGTH, BAR = 150.0, 12.0  # mm: between the bar's centres, of the bar
PLATE, BORDER = (160.0, 120.0, 10.0), 3.0  # mm: length, width, thickness; of the rim
POSITIONS = 10
SPEEDS = np.geomspace(10, 500, POSITIONS)  # mm/s, one per position
SEED = 26

# Figure: artefact, name in the table, bound in mm.
GOALS = {"PF_mm": ("sphere", "PF", 0.2), "PF_trimmed_mm": ("sphere", "PF, 3 per mille removed", 0.1),
         "SD_mm": ("ballbar", "SD", 0.02), "F_mm": ("plate", "F", 0.1)}
FIGURES = ["PF_mm", "PF_trimmed_mm", "PS_mm", "SD_mm", "SD_trimmed_mm", "F_mm", "F_trimmed_mm"]
VALUES = ["speed_mm_s", *FIGURES, "points", "coverage", "z_count", "z_below_1", "z_below_2", "z_below_3",
          "z_rms", "z_greatest", "left_out"]


# ---- artefacts ------------------------------------------------------------------------------------


def pose(position):
    """Turn and place of a position, for all artefacts alike: the first stands in the middle as it
    is, the others lie within 55 mm of it and are turned at random."""
    if position == 0:
        return np.eye(3), np.zeros(3)
    random = np.random.default_rng([SEED, position])
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    place = random.normal(size=3)
    return turn, 55 * random.uniform(0.5, 1) * place / np.linalg.norm(place)


def sphere(turn, place):
    vertices, triangles = shapes.ball((0, 0, 0), DIAMETER / 2, around=400)  # facets: 1 um off
    return vertices @ turn.T + place, triangles


def ball_bar(turn, place):
    ends = [(0, -LENGTH / 2, 0), (0, LENGTH / 2, 0)]
    parts = [shapes.ball(end, BALL / 2, around=320) for end in ends]
    vertices, triangles = shapes.joined([*parts, shapes.capsule(*ends, BAR / 2, around=96)])
    return vertices @ turn.T + place, triangles


def plate(turn, place):
    """Stands upright and faces the first camera, before it is turned."""
    length, width, thickness = PLATE
    vertices, triangles = shapes.cube(1, turn_deg=0)
    return (vertices * [thickness, length, width]) @ turn.T + place, triangles


ARTEFACTS = {
    "sphere": (sphere, [], ["--diameter", DIAMETER]),
    "ballbar": (ball_bar, [], ["--diameter", BALL, "--length", LENGTH, "--bar-diameter", BAR]),
    "plate": (plate, ["--flat"], ["--length", PLATE[0], "--width", PLATE[1], "--thickness", PLATE[2],
                                  "--border", BORDER]),
}


def velocity(position):
    """mm/s."""
    way = np.random.default_rng([SEED, 100 + position]).normal(size=3)
    return SPEEDS[position] * way / np.linalg.norm(way)


# ---- one position ---------------------------------------------------------------------------------


def rig_for(args, program, sensor):
    """The ring; with a mosaic on every camera for raw pictures."""
    path = args.out / "work" / f"{sensor}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    program("rig", "ring", "--overwrite", "--out", path, *(common.SMALL_RING if args.small else []))
    rig = json.loads(path.read_text())
    if sensor == "raw":
        for camera in rig["cameras"]:
            camera["mosaic"] = "RGGB"
    return common.write_rig(path, rig)


def figures_of(measured):
    """Flat figures of one position; of a bar's two balls the worse, their z-scores together."""
    position = measured["positions"][0]
    row = {k: measured["worst"].get(k) for k in FIGURES}
    row["points"], row["coverage"] = measured["worst"]["points"], measured["worst"]["coverage"]
    parts = position.get("balls", [position])
    row["left_out"] = sum(p.get("left_out", 0) for p in parts)
    scores = [p["z"] for p in parts if "z" in p]
    if scores:
        counts = [z["count"] for z in scores]
        row["z_count"], row["z_greatest"] = sum(counts), max(z["greatest"] for z in scores)
        for key in ("below_1", "below_2", "below_3"):
            row["z_" + key] = np.average([z[key] for z in scores], weights=counts)
        row["z_rms"] = math.sqrt(np.average([z["rms"] ** 2 for z in scores], weights=counts))
    return row


def measure(args, program, rows, artefact, sensor, motion, position):
    make, look, sizes = ARTEFACTS[artefact]
    work = args.out / "work" / f"{artefact}_{sensor}_{motion}_{position}"
    mesh, rig = work / "mesh.ply", args.out / "work" / f"{sensor}.json"
    common.write_ply(mesh, *make(*pose(position)))
    speed = velocity(position) if motion == "moving" else np.zeros(3)
    moves = [] if motion == "still" else ["--motion-mm-s", *speed, "--exposure-ms", args.exposure_ms]
    program("simulate", "--rig", rig, "--mesh", mesh, "--noise", "medium", "--seed", 1 + position,
            "--out", work / "scene", "--overwrite", *look, *moves)
    program("reconstruct", "--rig", rig, "--frames", work / "scene/frames", "--out", work / "result",
            "--overwrite", "--no-pictures")
    for surface in ("points", "mesh"):
        found = program("artefact", artefact, work / "result", *sizes, "--surface", surface,
                        may_fail=True)
        row = figures_of(found) if found else {}
        rows.add(artefact=artefact, sensor=sensor, motion=motion, position=position, surface=surface,
                 speed_mm_s=float(np.linalg.norm(speed)), **row)


# ---- tables ---------------------------------------------------------------------------------------


def worst(rows, key, **of):
    """The greatest by size; NaN where a position has none: that is no pass."""
    values = np.abs(rows.column(key, **of))
    return np.nan if len(values) == 0 or np.isnan(values).any() else values.max()


def summary(args, rows):
    header = ["artefact", "sensor", "", "surface", "positions", "figure", "asked, mm", "worst, mm", "median",
              "met in", "least coverage", "z < 1", "z < 2", "z < 3"]
    lines = []
    for key, (artefact, name, bound) in GOALS.items():
        for sensor in ("rgb", "raw"):
            for motion in ("still", "moving"):
                for surface in ("points", "mesh"):
                    of = {"artefact": artefact, "sensor": sensor, "motion": motion, "surface": surface}
                    values = np.abs(rows.column(key, **of))
                    if len(values) == 0:
                        continue
                    worst_one = worst(rows, key, **of)
                    text = common.number(worst_one)
                    z = [common.number(np.nanmean(rows.column(f"z_below_{k}", **of))
                                       if surface == "points" else np.nan, 2) for k in (1, 2, 3)]
                    lines.append([artefact, sensor, motion, surface, len(values), name, bound,
                                  text if worst_one <= bound else f"**{text}**",
                                  common.number(np.nanmedian(values)),
                                  f"{int((values <= bound).sum())} of {len(values)}",
                                  common.number(np.nanmin(rows.column("coverage", **of)), 2), *z])
    common.print_table(args.out / "table.md", "The worst of all positions; bold: missed", header, lines)


def by_speed(args, rows):
    """What motion does, position by position: points of three-channel cameras."""
    header = ["position", "speed, mm/s", *[f"{name}, {m}" for _, name, _ in GOALS.values()
                                           for m in ("still", "moving")]]
    lines = []
    for position in sorted({row["position"] for row in rows.rows}):
        line = [position, common.number(SPEEDS[position], 0)]
        for key, (artefact, _, _) in GOALS.items():
            for motion in ("still", "moving"):
                value = rows.column(key, artefact=artefact, sensor="rgb", motion=motion, position=position,
                                    surface="points")
                line.append(common.number(abs(value[0]) if len(value) else None))
        lines.append(line)
    common.print_table(args.out / "speeds.md", "By speed: points, three channels, mm", header, lines)


if __name__ == "__main__":
    arguments = common.arguments("acceptance", __doc__, positions=(POSITIONS, 1), exposure_ms=(1.0, 1.0),
                                 sensors=("rgb,raw", "rgb,raw"))
    if arguments.positions > POSITIONS:
        sys.exit(f"acceptance: --positions {arguments.positions}: at most {POSITIONS}")
    results = common.Rows(arguments.out / "results.csv",
                          ["artefact", "sensor", "motion", "position", "surface"], VALUES, arguments.resume)
    run = common.Program(arguments)
    for sensor in arguments.sensors.split(","):
        rig_for(arguments, run, sensor)
        for motion in ("still", "moving"):
            if arguments.small and (sensor == "raw") != (motion == "moving"):
                continue  # each of the four once
            for position in range(arguments.positions):
                for artefact in ARTEFACTS:
                    if results.has(artefact=artefact, sensor=sensor, motion=motion, position=position,
                                   surface="mesh"):
                        continue
                    measure(arguments, run, results, artefact, sensor, motion, position)
                    common.progress(f"acceptance: {artefact}, {sensor}, {motion}, {position}")
    summary(arguments, results)
    by_speed(arguments, results)
