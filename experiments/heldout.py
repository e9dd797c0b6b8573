#!/usr/bin/python3
"""Scenes kept apart: what results are on objects, pitches, noise and rigs that nothing was fitted to.

Two splits with nothing in common: constants and the error model are fitted on `fit` (the objects of
objects.py and more settings of them) and judged on `held` (other objects, other rigs). A seed turns
the object, draws its details and the noise anew. Scenes are rendered once and kept (--scenes), so
that only reconstruct and evaluate run again. Lengths are scaled to a working volume of 170 mm radius.
"""

import argparse
import dataclasses
import hashlib
import inspect
import json
import math
import resource
import shutil
import sys
import zlib
from pathlib import Path

import numpy as np

import common
import objects
import shapes
import solids
import statues

VOLUME_RADIUS = 170.0  # mm, of `rig ring`; results of larger rigs are scaled to it
SCALES = (0.001, 0.01, 30.0)  # of the rig, for the same images
SCALED_SCENE = "bust"  # of the held split


# ---- the scenes -----------------------------------------------------------------------------------

PERSON = ["--distance-mm", 3000, "--volume-radius-mm", 950, "--camera-focal-px", 1350,
          "--projector-focal-px", 1420]
RIGS = {  # options of `rig ring`
    "six": [],
    "eight": ["--cameras", 8, "--projectors", 8],
    "four": ["--cameras", 4, "--projectors", 4],
    "two": ["--cameras", 2, "--projectors", 2, "--arc-deg", 90],
    # All projectors alike: red, green and blue; 9 and 27 lines a period.
    "rgb9": ["--cameras", 4, "--projectors", 4, "--colors", "red,green,blue", "--order", 2],
    "rgb27": ["--cameras", 4, "--projectors", 4, "--colors", "red,green,blue", "--order", 3],
    # The paper's Fig. 4: one vertical and two tilted patterns, two of a colour.
    "fig4": ["--cameras", 3, "--projectors", 3, "--arc-deg", 150, "--lines", "vertical",
             "--roll-deg", 0, 40, -40],
    "person": ["--cameras", 8, "--projectors", 8, *PERSON],
    "person_four": ["--cameras", 4, "--projectors", 4, *PERSON],
}
# Bounds of the label error (share) and of line recall by kind of scene; what lies farther off than
# 2 mm, of points and of the mesh.
KINDS = {
    "plain": {"label_error": 0.0010, "line_recall": 0.965, "points": 0.0002, "mesh": 0.0003},
    "intricate": {"label_error": 0.0030, "line_recall": 0.92, "points": 0.001, "mesh": 0.0015},
    "eight": {"label_error": 0.0020, "line_recall": 0.92, "points": 0.0002, "mesh": 0.0003},
    "four": {"label_error": 0.0020, "line_recall": 0.92, "points": 0.0002, "mesh": 0.0003},
    "person": {"label_error": 0.0050, "line_recall": 0.92, "points": 0.0002, "mesh": 0.0003},
    "rgb": {"label_error": 0.0030, "line_recall": 0.93, "points": 0.0005, "mesh": 0.0015},
}


@dataclasses.dataclass(frozen=True)
class Scene:
    object: str
    rig: str
    pitch_px: float
    noise: str
    kind: str  # one of KINDS
    options: tuple = ()  # of simulate


def fitted_objects(name):
    """An object of objects.py; what the splits share is no object."""
    return lambda seed: objects.OBJECTS[name][1]()


MAKERS = {
    **{name: fitted_objects(name) for name in ("bunny", "cat", "balls", "horse", "hand", "knot")},
    "cube": lambda seed: shapes.cube(190),
    **{name: getattr(statues, name)
       for name in ("bust", "vase", "gyroid", "bent_hand", "person", "dragon", "rock", "part")},
}
SPLITS = {
    "held": {
        "bust": Scene("bust", "six", 12, "medium", "plain"),
        "bust_p8": Scene("bust", "six", 8, "medium", "plain"),
        "vase_p10": Scene("vase", "six", 10, "high", "plain"),
        "rock_p10": Scene("rock", "six", 10, "low", "plain"),
        "part": Scene("part", "six", 12, "high", "plain"),
        "gyroid": Scene("gyroid", "six", 12, "medium", "intricate"),
        "bent_hand_p8": Scene("bent_hand", "six", 8, "low", "intricate"),
        "dragon_p10": Scene("dragon", "six", 10, "medium", "intricate"),
        "rock_eight": Scene("rock", "eight", 12, "medium", "eight"),
        "dragon_eight": Scene("dragon", "eight", 10, "medium", "eight"),
        "bent_hand_four": Scene("bent_hand", "four", 12, "medium", "four"),
        "bust_four": Scene("bust", "four", 10, "high", "four"),
        "vase_two": Scene("vase", "two", 12, "medium", "four"),
        "bust_rgb9": Scene("bust", "rgb9", 12, "medium", "rgb"),
        "rock_rgb27": Scene("rock", "rgb27", 12, "low", "rgb"),
        "vase_fig4": Scene("vase", "fig4", 12, "medium", "four"),
        "person": Scene("person", "person", 10, "medium", "person"),
    },
    "fit": {
        "bunny": Scene("bunny", "six", 12, "medium", "plain"),
        "bunny_p8": Scene("bunny", "six", 8, "low", "plain"),
        "bunny_texture": Scene("bunny", "six", 10, "medium", "plain",
                               ("--texture", "noise", "--contrast", 0.5)),
        "cat_p10": Scene("cat", "six", 10, "high", "plain"),
        "balls": Scene("balls", "six", 12, "medium", "plain"),
        "hand_p8": Scene("hand", "six", 8, "medium", "intricate"),
        "horse": Scene("horse", "six", 12, "medium", "intricate"),
        "knot_p10": Scene("knot", "six", 10, "low", "intricate"),
        "knot_eight": Scene("knot", "eight", 12, "medium", "eight"),
        "horse_four": Scene("horse", "four", 10, "low", "four"),
        "bunny_four": Scene("bunny", "four", 12, "high", "four"),
        "cube_two": Scene("cube", "two", 12, "medium", "four", ("--flat",)),
        "balls_two": Scene("balls", "two", 10, "high", "four"),
        "cat_rgb9": Scene("cat", "rgb9", 12, "medium", "rgb"),
        "hand_person_four": Scene("hand", "person_four", 8, "medium", "four"),
    },
}
SMALL = {"rock_small": Scene("rock", "small", 20, "medium", "four")}


def placed(scene, seed, volume):
    """The mesh of a scene: turned as the seed says, in the middle of the volume; a person keeps his
    size."""
    vertices, triangles = MAKERS[scene.object](seed)
    name = zlib.crc32(scene.object.encode())  # objects of one split do not all turn alike
    random = np.random.default_rng([seed, name])
    tilt = 0 if scene.object == "person" else random.uniform(-0.15, 0.15)
    turn = random.uniform(-math.pi, math.pi)
    vertices = vertices @ common._rotation(np.array([tilt, 0, 0])).T
    vertices = vertices @ common._rotation(np.array([0, 0, turn])).T
    vertices = vertices - (vertices.min(0) + vertices.max(0)) / 2
    reach = np.linalg.norm(vertices, axis=1).max()
    wanted = 0.95 * volume["radius"]
    if scene.object != "person" or reach > wanted:
        vertices = vertices * wanted / reach
    return vertices + volume["center"], triangles


def fingerprint(scene, seed):
    """Of everything that a rendered scene depends on but the simulator."""
    maker = MAKERS[scene.object]
    code = "".join(inspect.getsource(m) for m in (maker, placed, objects, statues, solids, shapes))
    text = json.dumps([dataclasses.asdict(scene), [str(o) for o in rig_options(scene)], seed, code])
    return hashlib.sha256(text.encode()).hexdigest()


def rig_options(scene):
    ring = common.SMALL_RING if scene.rig == "small" else RIGS[scene.rig]
    own = [] if scene.rig == "small" else ["--pitch-px", scene.pitch_px,
                                           "--line-width-px", scene.pitch_px / 3,
                                           "--offset-px", scene.pitch_px / 2]
    return [*ring, *own]


def rendered(program, folder, scene, seed):
    """The scene in `folder`: as an earlier run left it, or made now. It appears whole or not."""
    stamp = fingerprint(scene, seed)
    if (folder / "stamp").exists() and (folder / "stamp").read_text() == stamp:
        return folder
    draft = folder.with_name(folder.name + ".draft")
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    program("rig", "ring", "--overwrite", "--out", draft / "ring.json", *rig_options(scene))
    volume = json.loads((draft / "ring.json").read_text())["volume"]
    common.write_ply(draft / "mesh.ply", *placed(scene, seed, volume))
    program("simulate", "--rig", draft / "ring.json", "--mesh", draft / "mesh.ply", "--noise",
            scene.noise, "--seed", 1000 * seed + 7, "--out", draft / "scene", *scene.options)
    (draft / "scene" / "stamp").write_text(stamp)
    shutil.rmtree(folder, ignore_errors=True)
    (draft / "scene").rename(folder)
    shutil.rmtree(draft)
    return folder


# ---- the same in another unit ---------------------------------------------------------------------


def scaled_rig(rig, factor):
    result = json.loads(json.dumps(rig))
    for device in result["cameras"] + result["projectors"]:
        device["t"] = [factor * x for x in device["t"]]
    if "volume" in result:
        result["volume"] = {"center": [factor * x for x in result["volume"]["center"]],
                            "radius": factor * result["volume"]["radius"]}
    return result


def scale_ply(source, target, factor):
    """A PLY file with its positions and deviations times `factor`."""
    data = bytearray(Path(source).read_bytes())
    end = data.index(b"end_header\n") + len(b"end_header\n")
    vertices = common.read_ply(source)[0].copy()
    for name in ("x", "y", "z", "sigma"):
        if name in (vertices.dtype.names or ()):
            vertices[name] = vertices[name].astype(float) * factor
    data[end:end + vertices.nbytes] = vertices.tobytes()
    Path(target).write_bytes(data)


def scaled_result(result, folder, factor):
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("points.ply", "mesh_measured.ply", "mesh.ply"):
        if (result / name).exists():
            scale_ply(result / name, folder / name, factor)
    return folder


# ---- figures --------------------------------------------------------------------------------------


def open_edges(path):
    """Edges of a mesh that do not have exactly two facets."""
    _, triangles = common.read_ply(path)
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), 1)
    key = edges[:, 0].astype(np.int64) << 32 | edges[:, 1]
    return int((np.unique(key, return_counts=True)[1] != 2).sum())


def confident_wrong(figures):
    """Of the points with confidence >= .999: the share that is wrong, what they say themselves, their number."""
    sums = [(b["points"], b["points"] * (1 - b["right"]), b["points"] * (1 - b["confidence"]))
            for b in figures.get("right_by_confidence", []) if b["confidence"] >= 0.999]
    total, wrong, said = (sum(s[k] for s in sums) for k in range(3))
    return wrong / max(1, total), said / max(1, total), total


def measure(args, program, folder, rig_path, frames, work, factor=1.0):
    """Reconstructs frames and judges the result, all lengths times `factor` first; an empty dict
    where the program failed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    shutil.rmtree(work, ignore_errors=True)
    done = program("reconstruct", "--rig", rig_path, "--frames", frames, "--out", work / "result",
                   "--no-pictures", *args.reconstruct.split(), may_crash=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done is None:
        return {}
    result, truth, rig = work / "result/000000", folder / "truth/mesh.ply", folder / "rig.json"
    own = json.loads(rig.read_text())
    to_common = VOLUME_RADIUS / own["volume"]["radius"] if "volume" in own else 1.0
    if factor * to_common != 1:
        result = scaled_result(result, work / "scaled", factor * to_common)
    if to_common != 1:
        rig = common.write_rig(work / "scaled/rig.json", scaled_rig(own, to_common))
        scale_ply(truth, work / "scaled/truth.ply", to_common)
        truth = work / "scaled/truth.ply"
    figures = program("evaluate", "--truth", truth, "--rig", rig, "--result", result, may_crash=True)
    if figures is None:
        return {}
    figures["cpu_s"] = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    figures["sure_wrong"], figures["sure_said"], figures["sure_points"] = confident_wrong(figures)
    if (result / "mesh.ply").exists():
        figures["open_edges"] = open_edges(result / "mesh.ply")
    (work / "figures.json").write_text(json.dumps(figures, indent=1))
    if not args.keep:
        shutil.rmtree(work / "scaled", ignore_errors=True)
        shutil.rmtree(work / "result")
    return figures


# Columns: key, name in the table, factor, digits, bound: (least, most), or a function of the row.
def most(key):
    return lambda row: (-math.inf, KINDS[row["kind"]][key])


def least(key):
    return lambda row: (KINDS[row["kind"]][key], math.inf)


def sure_bound(row):
    """Three times what the points say; one wrong point of so few is no verdict. Shares are rounded."""
    return (-math.inf, max(3 * row["sure_said"], 1.5 / max(1, row["sure_points"])))


ONE, TWO, RANK = (0.62, 0.74), (0.92, 0.98), (0.4, math.inf)
ANY = (-math.inf, math.inf)
COLUMNS = [
    ("label_error", "label error, %", 100, 3, most("label_error")),
    ("line_recall", "recall", 1, 3, least("line_recall")),
    ("line_recall_3_5px", "3-5 px", 1, 2, ANY),
    ("distance_median_mm", "points: median", 1, 3, ANY),
    ("distance_p90_mm", "90 %", 1, 3, ANY),
    ("share_above_2mm", "> 2 mm, %", 100, 3, most("points")),
    ("sigma_below_1", "1 sigma", 1, 3, ONE),
    ("sigma_below_2", "2 sigma", 1, 3, TWO),
    ("sigma_rank_correlation", "rank", 1, 2, RANK),
    ("mesh_distance_median_mm", "mesh: median", 1, 3, ANY),
    ("mesh_distance_p90_mm", "90 %", 1, 3, ANY),
    ("mesh_share_above_2mm", "> 2 mm, %", 100, 3, most("mesh")),
    ("mesh_sigma_below_1", "1 sigma", 1, 3, ONE),
    ("mesh_sigma_below_2", "2 sigma", 1, 3, TWO),
    ("mesh_sigma_rank_correlation", "rank", 1, 2, RANK),
    ("completeness_1mm", "complete", 1, 3, ANY),
    ("sure_wrong", "sure: wrong, %", 100, 3, sure_bound),
    ("sure_said", "said, %", 100, 3, ANY),
    ("sure_points", "of points", 1, 0, ANY),
    ("open_edges", "edges not of 2 facets", 1, 0, (-math.inf, 0)),
    ("cpu_s", "CPU s", 1, 0, ANY),
]
# A scaled rig: these within 1 % of the same scene unscaled, label error within .0002.
SCALE_INVARIANT = ["distance_median_mm", "distance_p90_mm", "mesh_distance_median_mm",
                   "mesh_distance_p90_mm", "sigma_below_1", "sigma_below_2", "mesh_sigma_below_1",
                   "mesh_sigma_below_2"]


def in_bounds(row, key, bound):
    if row[key] == "":
        return False
    low, high = bound(row) if callable(bound) else bound
    return low <= row[key] <= high


def missed(row):
    return [name for key, name, _, _, bound in COLUMNS if not in_bounds(row, key, bound)]


def missed_by_scaling(row, reference):
    """Figures that are not those of the unscaled scene, or that one of both lacks."""
    def differs(key, absolute=0.0, relative=0.0):
        if "" in (row[key], reference[key]):
            return True
        return abs(row[key] - reference[key]) > absolute + relative * abs(reference[key])

    wrong = ["label_error"] if differs("label_error", absolute=2e-4) else []
    return wrong + [key for key in SCALE_INVARIANT if differs(key, relative=0.01)]


def table(args, rows):
    header = ["scene", "seed", *[c[1] for c in COLUMNS], "verdict"]
    lines, passed = [], 0
    for row in rows.rows:
        if row["scale"] == 1:
            wrong = missed(row)
        else:
            unscaled = rows.select(scene=row["scene"], seed=row["seed"], scale=1)
            reference = [other for other in unscaled if other["label_error"] != ""]
            wrong = missed_by_scaling(row, reference[0]) if reference else ["no reference"]
        cells = []
        for key, _, factor, digits, bound in COLUMNS:
            text = common.number(row[key] * factor, digits) if row[key] != "" else "-"
            bad = key in wrong if row["scale"] != 1 else not in_bounds(row, key, bound)
            cells.append(f"**{text}**" if bad else text)
        name = row["scene"] if row["scale"] == 1 else f"{row['scene']} x {row['scale']:g}"
        verdict = "failed" if row["label_error"] == "" else "pass" if not wrong else f"{len(wrong)} missed"
        passed += verdict == "pass"
        lines.append([name, row["seed"], *cells, verdict])
    common.print_table(args.out / "table.md", f"{args.split}: {passed} of {len(lines)} scenes within all "
                       "bounds; bold: missed; lengths in mm, scaled to a volume of 170 mm radius", header,
                       lines)


# ---- the run --------------------------------------------------------------------------------------


def options():
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--split", choices=[*SPLITS, "both"], default="held")
    parser.add_argument("--seeds", default="1", help="draws of every scene: 1,2 (default 1)")
    parser.add_argument("--scenes", type=Path, help="rendered scenes (default: scenes in --out)")
    parser.add_argument("--folder", type=Path, action="append", default=[],
                        help="a scene made elsewhere: rig.json, frames, truth/mesh.ply; may repeat")
    parser.add_argument("--reconstruct", default="", help="further options of reconstruct")
    parser.add_argument("--no-scales", action="store_true", help="without the scaled rigs")
    parser.add_argument("--render-only", action="store_true", help="make the scenes and stop")
    parser.add_argument("--keep", action="store_true", help="keep the results beside the figures")
    return parser


def chosen_scenes(args):
    if args.small:
        return SMALL
    if args.only == "none":
        return {}
    scenes = {name: scene for split, of_split in SPLITS.items() if args.split in (split, "both")
              for name, scene in of_split.items()}
    if not args.only:
        return scenes
    unknown = set(args.only.split(",")) - scenes.keys()
    if unknown:
        sys.exit(f"no such scene: {', '.join(sorted(unknown))}; there are {', '.join(scenes)}")
    return {name: scenes[name] for name in args.only.split(",")}


def run(args):
    program = common.Program(args, memory_gb=10)
    results = common.Rows(args.out / "results.csv", ["scene", "seed", "scale"],
                          ["kind", *[c[0] for c in COLUMNS]], args.resume)

    def add(name, seed, scale, kind, folder, rig_path, frames, work):
        if results.has(scene=name, seed=seed, scale=scale):
            return
        figures = measure(args, program, folder, rig_path, frames, work, 1 / scale)
        results.add(scene=name, seed=seed, scale=scale, kind=kind,
                    **{c[0]: figures.get(c[0]) for c in COLUMNS})
        common.progress(f"heldout: {name} seed {seed}" + (f" x {scale:g}" if scale != 1 else ""))

    for seed in map(int, args.seeds.split(",")):
        for name, scene in chosen_scenes(args).items():
            folder = rendered(program, (args.scenes or args.out / "scenes") / f"{name}_s{seed}", scene, seed)
            if args.render_only:
                continue
            work = args.out / "work" / f"{name}_s{seed}"
            add(name, seed, 1, scene.kind, folder, folder / "rig.json", folder / "frames", work)
            if args.no_scales or (name != SCALED_SCENE and not args.small):
                continue
            for scale in SCALES[:1] if args.small else SCALES:
                rig = scaled_rig(json.loads((folder / "rig.json").read_text()), scale)
                rig["unit"] = "unknown"
                path = common.write_rig(args.out / "work" / f"rig_x{scale:g}.json", rig)
                add(name, seed, scale, scene.kind, folder, path, folder / "frames",
                    work.with_name(work.name + f"_x{scale:g}"))
    for folder in args.folder:
        add(folder.name, 0, 1, "plain", folder, folder / "rig.json", folder / "frames",
            args.out / "work" / folder.name)
    if not args.render_only:
        table(args, results)


if __name__ == "__main__":
    run(common.arguments("heldout", __doc__, parents=[options()], only=("", "")))
