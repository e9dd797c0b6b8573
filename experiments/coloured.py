#!/usr/bin/python3
"""Coloured objects: how many lines have their name where a surface lacks channels, with the pattern's code and without.

Objects before rings of devices (640 x 480, medium noise) are rendered white without noise; each picture is then painted by
the place that a pixel sees, and taken by the cameras (`simulate --light`). Without its code (one colour per pattern) the
same lines have their names from crossings alone: a code should make it no worse.
"""

import json

import cv2
import numpy as np

import common
import heldout

RIGS = {"6 + 6": ["--cameras", 6, "--projectors", 6], "4 + 4": ["--cameras", 4, "--projectors", 4]}
CAMERA = ["--camera-width", 640, "--camera-height", 480, "--camera-focal-px", 1150, "--pitch-px", 16,
          "--line-width-px", 5.33, "--offset-px", 8]
OBJECTS = {"bunny": 3, "rock": 7}  # and their seeds
PAINTS = {"red": (1, 0.06, 0.05), "green": (0.06, 0.5, 0.08), "blue": (0.06, 0.1, 0.8), "yellow": (1, 0.9, 0.05),
          "magenta": (0.8, 0.06, 0.6), "cyan": (0.05, 0.7, 0.8), "white": (1, 1, 1)}
COLUMNS = ["label_error", "line_recall", "mesh_distance_median_mm", "mesh_share_above_2mm", "completeness_1mm", "doubts"]
# What accuses devices, or says that names may be wrong.
DOUBTS = {"names-doubtful", "rig-is-off", "device-is-off", "wrong-picture", "few-names"}


def patches(places, size_mm):
    random = np.random.default_rng(11)
    seeds = random.uniform(-180, 180, (int((360 / size_mm) ** 3), 3))
    of_seed = random.integers(0, len(PAINTS), len(seeds))
    index = np.zeros(len(places), int)
    for begin in range(0, len(places), 4096):
        part = places[begin:begin + 4096]
        index[begin:begin + 4096] = np.argmin(((part[:, None] - seeds) ** 2).sum(-1), axis=1)
    return np.array(list(PAINTS.values()))[of_seed[index]]


def halves(places, axis_mm):
    return np.where((places[:, 2] > axis_mm)[:, None], [PAINTS["red"]], [PAINTS["blue"]])


def stripes(places, width_mm):
    return np.where((np.floor(places[:, 0] / width_mm) % 2 == 0)[:, None], [PAINTS["red"]], [PAINTS["blue"]])


def rainbow(places, period_mm):
    hue = 2 * np.pi * (places[:, 0] + places[:, 2])[:, None] / period_mm
    return np.clip(0.5 + 0.5 * np.cos(hue - [0, 2 * np.pi / 3, 4 * np.pi / 3]), 0.03, 1)


PAINTINGS = {"white": lambda x: np.ones_like(x), "red": lambda x: np.full_like(x, PAINTS["red"]),
             "blue": lambda x: np.full_like(x, PAINTS["blue"]), "red above, blue below": lambda x: halves(x, 0),
             "stripes of 24 mm, red and blue": lambda x: stripes(x, 24),
             "patches of 40 mm in seven colours": lambda x: patches(x, 40),
             "a rainbow, 120 mm long": lambda x: rainbow(x, 120)}
SMALL = ["red above, blue below"]


def painted(camera, scene, painting):
    """The camera's light (BGR, 16 bits) with the surface in its colours."""
    light = cv2.imread(str(scene / "frames/000000" / (camera["name"] + ".png")), cv2.IMREAD_UNCHANGED)
    depth = cv2.imread(str(scene / "truth/depth" / (camera["name"] + ".tiff")), cv2.IMREAD_UNCHANGED)
    seen = np.nan_to_num(depth, nan=0, posinf=0).astype(np.float32)
    seen = np.where(seen > 0, seen, cv2.dilate(seen, np.ones((5, 5))))  # blur carries rims over the background
    v, u = np.mgrid[:depth.shape[0], :depth.shape[1]]
    rays = np.stack([u, v, np.ones_like(u)], -1).reshape(-1, 3) @ np.linalg.inv(camera["K"]).T
    places = (rays * seen.reshape(-1, 1) - camera["t"]) @ np.array(camera["R"])
    rgb = np.ones_like(places)
    on_object = seen.reshape(-1) > 0
    rgb[on_object] = painting(places[on_object])
    return np.clip(light * rgb.reshape(light.shape)[..., ::-1] + 0.5, 0, 65535).astype(np.uint16)


def without_code(rig):
    rig = json.loads(json.dumps(rig))
    for projector in rig["projectors"]:
        pattern = projector["pattern"]
        pattern.update(colors=[{"yellow": "red", "cyan": "blue"}.get(pattern["colors"][0], pattern["colors"][0])],
                       alphabet=1, order=1)
    return rig


def measured(program, folder, scene, rig):
    program("reconstruct", "--overwrite", "--no-pictures", "--rig", rig, "--frames", folder / "scene/frames", "--out",
            folder / "result")
    figures = program("evaluate", "--rig", rig, "--truth", scene / "truth/mesh.ply", "--result", folder / "result/000000")
    report = json.loads((folder / "result/000000/report.json").read_text())
    figures["doubts"] = sum(finding["code"] in DOUBTS for finding in report["findings"])
    return figures


def main():
    args = common.arguments("coloured", __doc__)
    program = common.Program(args)
    rows = common.Rows(args.out / "results.csv", ["rig", "object", "painting", "code"], COLUMNS, args.resume)
    for rig_name, options in [list(RIGS.items())[1]] if args.small else RIGS.items():
        for name, seed in list(OBJECTS.items())[:1] if args.small else OBJECTS.items():
            base = args.out / rig_name.replace(" ", "") / name
            base.mkdir(parents=True, exist_ok=True)
            program("rig", "ring", "--overwrite", "--out", base / "ring.json", *options, *CAMERA)
            common.write_ply(base / "mesh.ply", *heldout.MAKERS[name](seed))
            scene = base / "white"
            program("simulate", "--overwrite", "--rig", base / "ring.json", "--mesh", base / "mesh.ply", "--fit", "--out",
                    scene, "--bits", 16, "--truth-maps", "--noise", "none")
            rig = json.loads((scene / "rig.json").read_text())
            common.write_rig(base / "no_code.json", without_code(rig))
            for painting in SMALL if args.small else PAINTINGS:
                folder = base / painting.replace(" ", "_").replace(",", "")
                common.progress(f"coloured: {rig_name}, {name}, {painting}")
                light = folder / "light/000000"
                light.mkdir(parents=True, exist_ok=True)
                for camera in rig["cameras"]:
                    cv2.imwrite(str(light / (camera["name"] + ".png")), painted(camera, scene, PAINTINGS[painting]))
                program("simulate", "--overwrite", "--rig", scene / "rig.json", "--mesh", scene / "truth/mesh.ply",
                        "--light", folder / "light", "--out", folder / "scene", "--noise", "medium")
                for code, of in (("code", scene / "rig.json"), ("none", base / "no_code.json")):
                    if not rows.has(rig=rig_name, object=name, painting=painting, code=code):
                        figures = measured(program, folder, scene, of)
                        rows.add(rig=rig_name, object=name, painting=painting, code=code,
                                 **{key: figures[key] for key in COLUMNS})
    table = []
    for rig_name in RIGS:
        for painting in PAINTINGS:
            cells = {}
            for code in ("code", "none"):
                chosen = {"rig": rig_name, "painting": painting, "code": code}
                cells[code] = {key: rows.column(key, **chosen) for key in COLUMNS}
            if len(cells["code"]["line_recall"]) == 0:
                continue
            both = [" / ".join(f"{scale * np.mean(cells[code][key]):.{digits}f}" for code in ("code", "none"))
                    for key, scale, digits in (("label_error", 100, 2), ("line_recall", 1, 3), ("completeness_1mm", 1, 3),
                                               ("mesh_share_above_2mm", 100, 2), ("doubts", 1, 1))]
            table.append([rig_name, painting, *both])
    common.print_table(args.out / "table.md", "Coloured objects: with the code / without it",
                       ["rig", "object", "label error, %", "line recall", "complete within 1 mm", "mesh beyond 2 mm, %",
                        "doubts a frame"], table)


if __name__ == "__main__":
    main()
