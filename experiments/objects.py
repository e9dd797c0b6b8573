#!/usr/bin/python3
"""Other objects: what one frame gives of statues, thin, textured and shiny things.

Six cameras, six projectors, 12 px pitch, medium noise, seed 1: the rig of `rig ring` as it is. Every
object is rendered once and reconstructed as a user would; its points and its measured surface are
judged by their truth. Horse and cat are of Debian's glmark2-data, the others are made from formulas.
"""

import subprocess
import tempfile
from pathlib import Path

import common
import shapes

MODELS = common.BUNNY.parent


def model(name):
    """A mesh of glmark2-data, which Assimp's converter reads; z up."""
    def make():
        with tempfile.TemporaryDirectory() as folder:
            obj = Path(folder) / "model.obj"
            subprocess.run(["assimp", "export", MODELS / name, obj], check=True, capture_output=True)
            vertices, triangles = shapes.read_obj(obj)
        return vertices * [1, -1, -1], triangles
    return make


def balls():
    return shapes.joined([shapes.ball((60, -30, -20), 45), shapes.ball((-40, 20, 20), 75)])


# name: what it stands for, its maker, options of simulate, is it intricate or thin
OBJECTS = {
    "bunny": ("plain", shapes.bunny, [], False),
    "texture": ("bunny, albedo 0.4 to 0.8", shapes.bunny, ["--texture", "noise", "--contrast", 0.5], False),
    "specular": ("bunny, shiny", shapes.bunny, ["--specular", 0.3, "--roughness", 0.05], False),
    "cat": ("statue, open below", model("cat.3ds"), [], False),
    "balls": ("two balls, one before the other", balls, [], False),
    "horse": ("statue with thin legs", model("horse.3ds"), [], True),
    "hand": ("fingers of 10 to 15 mm", lambda: shapes.hand(13)[:2], [], True),
    "knot": ("tube of 26 mm", lambda: shapes.knot(125, 26), [], True),
}

# Columns: key of evaluate, name in the table, factor, digits, bounds asked of bunny-like and of
# intricate or thin objects (least and most, or one of them).
COLUMNS = [
    ("label_error", "label error, %", 100, 2, 0.2, 0.5),
    ("line_recall", "line recall", 1, 3, 0.95, 0.90),
    ("line_recall_3_5px", "recall, 3-5 px", 1, 2, 0.70, 0.60),
    ("distance_median_mm", "points: median, mm", 1, 3, 0.04, 0.05),
    ("distance_p90_mm", "90 %, mm", 1, 2, 0.15, 0.2),
    ("share_above_2mm", "> 2 mm, %", 100, 2, 0.1, 0.3),
    ("sigma_below_1", "below sigma", 1, 2, (0.60, 0.76), (0.60, 0.76)),
    ("sigma_below_2", "2 sigma", 1, 2, (0.92, 0.98), (0.92, 0.98)),
    ("sigma_rank_correlation", "rank", 1, 2, 0.4, 0.4),
    ("mesh_distance_median_mm", "surface: median, mm", 1, 3, 0.03, 0.05),
    ("mesh_distance_p90_mm", "90 %, mm", 1, 3, 0.10, 0.20),
    ("mesh_share_above_2mm", "> 2 mm, %", 100, 2, 0.05, 0.2),
    ("mesh_sigma_below_1", "below sigma", 1, 2, (0.60, 0.76), (0.60, 0.76)),
    ("completeness_1mm", "complete at 1 mm", 1, 3, 0.985, 0.96),
]
AT_LEAST = {"line_recall", "line_recall_3_5px", "sigma_rank_correlation", "completeness_1mm"}


def measure(args, program, name):
    _, make, options, _ = OBJECTS[name]
    work = args.out / "work" / name
    work.mkdir(parents=True, exist_ok=True)
    rig, mesh = work / "rig.json", work / "mesh.ply"
    common.write_ply(mesh, *make())
    program("rig", "ring", "--overwrite", "--out", rig, *(common.SMALL_RING if args.small else []))
    program("simulate", "--rig", rig, "--mesh", mesh, "--noise", "medium", "--seed", 1, "--fit",
            "--out", work / "scene", "--overwrite", *options)
    program("reconstruct", "--rig", rig, "--frames", work / "scene/frames", "--out", work / "result",
            "--overwrite", *([] if args.pictures else ["--no-pictures"]))
    return program("evaluate", "--truth", work / "scene/truth/mesh.ply", "--rig", rig, "--result",
                      work / "result/000000")


def range_of(key, bound):
    if isinstance(bound, tuple):
        return bound
    return (bound, float("inf")) if key in AT_LEAST else (-float("inf"), bound)


def asked(key, bound):
    if isinstance(bound, tuple):
        return f"{bound[0]} to {bound[1]}"
    return f"{'>=' if key in AT_LEAST else '<='} {bound}"


def table(args, rows):
    def cell(row, key, factor, digits, bounds):
        value = row[key]
        if value == "":
            return "-"
        bound = bounds[1 if OBJECTS[row["object"]][3] else 0]
        least, most = range_of(key, bound)
        text = common.number(value * factor, digits)
        return text if least <= value * factor <= most else f"**{text}**"

    header = ["object", "", *[c[1] for c in COLUMNS]]
    lines = [["asked", "", *[asked(c[0], c[4]) for c in COLUMNS]],
             ["asked", "intricate or thin", *[asked(c[0], c[5]) for c in COLUMNS]]]
    for row in rows.rows:
        lines.append([row["object"], OBJECTS[row["object"]][0],
                      *[cell(row, key, factor, digits, bounds)
                        for key, _, factor, digits, *bounds in COLUMNS]])
    common.print_table(args.out / "table.md", "Eight objects, one frame each; bold: missed", header,
                       lines)


if __name__ == "__main__":
    arguments = common.arguments("objects", __doc__, only=("", "hand"), pictures=(0, 0))
    results = common.Rows(arguments.out / "results.csv", ["object"], [c[0] for c in COLUMNS],
                          arguments.resume)
    for chosen in arguments.only.split(",") if arguments.only else OBJECTS:
        if results.has(object=chosen):
            continue
        figures = measure(arguments, common.Program(arguments), chosen)
        results.add(object=chosen, **{c[0]: figures.get(c[0]) for c in COLUMNS})
        common.progress(f"objects: {chosen}")
    table(arguments, results)
