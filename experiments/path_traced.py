#!/usr/bin/python3
"""Path-traced scenes: skin, marble, gloss, floors and rooms that catch the lines.

Objects of the held-out split before six cameras and six projectors (1280 x 960, pitch 12), their light path-traced by
Blender's Cycles: scattering below the surface, gloss, light from surface to surface, lenses with depth of field. The
same light then goes through four sensors. Nothing of the program was fitted to these scenes.
"""

import json
import math
import shutil
import subprocess

import numpy as np

import common
import heldout

SEED = 3
REACH = 0.95  # of the volume's radius
FLOOR, ROOM = {"radius": 350, "albedo": 0.4}, {"half": 2600, "albedo": 0.4}
# Mean free paths (mm, red, green, blue) after Jensen et al. 2001, table of measured materials, rounded up to whole mm.
SKIN = {"Base Color": [0.8, 0.62, 0.5, 1], "Subsurface": 0.25, "Subsurface Color": [0.85, 0.5, 0.4, 1],
        "Subsurface Radius": [12, 5, 3], "Roughness": 0.4, "Specular": 0.4}
MARBLE = {"Base Color": [0.85, 0.83, 0.8, 1], "Subsurface": 0.6, "Subsurface Color": [0.9, 0.88, 0.85, 1],
          "Subsurface Radius": [9, 6, 4], "Roughness": 0.35, "Specular": 0.4}
GLOSS = {"Base Color": [0.6, 0.6, 0.6, 1], "Roughness": 0.2, "Specular": 0.8}
GLAZE = {"Base Color": [0.7, 0.7, 0.72, 1], "Roughness": 0.3, "Specular": 0.5, "Clearcoat": 0.5}
# Name: the object, how it is turned (degrees), the scene as Blender's render.py reads it.
SCENES = {
    "hand of skin": ("bent_hand", 20, {"material": SKIN}),
    "bust of marble, floor and walls": ("bust", 20, {"material": MARBLE, "floor": FLOOR, "room": ROOM}),
    "glossy dragon": ("dragon", 50, {"material": GLOSS}),
    "glazed vase, white floor, near walls": (
        "vase", 20, {"material": GLAZE, "bounces": 6, "floor": {"radius": 600, "albedo": 0.7},
                     "room": {"half": 1800, "albedo": 0.6}}),
}
SMALL = ["glossy dragon"]
SENSORS = {  # what the rig states of its cameras, options of simulate
    "three channels": ({}, []),
    "raw mosaic": ({"mosaic": "RGGB"}, []),
    "colours filled in": ({}, ["--interpolated", "RGGB"]),
    "the same, gamma 2.2, JPEG 92": ({"gamma": 2.2}, ["--interpolated", "RGGB", "--jpeg", 92]),
}
COLUMNS = ["label_error", "line_recall", "distance_median_mm", "share_above_2mm", "mesh_distance_median_mm",
           "mesh_share_above_2mm", "completeness_1mm", "sigma_below_1", "mesh_sigma_below_1"]


def standing(name, turn_deg, radius):
    """An object upright in the middle of the volume."""
    vertices, triangles = heldout.MAKERS[name](SEED)
    vertices = vertices @ common._rotation(np.array([0, 0, math.radians(turn_deg)])).T
    vertices = vertices - (vertices.min(0) + vertices.max(0)) / 2
    return vertices * REACH * radius / np.linalg.norm(vertices, axis=1).max(), triangles


def render(folder, log):
    """Runs Blender over a scene; pictures that are there stay."""
    command = ["blender", "-b", "-P", str(folder / "render.py")]
    if subprocess.run(command, stdout=log, stderr=log).returncode != 0:
        raise SystemExit(f"path_traced: blender failed: see {log.name}")


def traced(args, program, folder, name):
    """Rig, mesh and light of a scene, as an earlier run left them, or made now."""
    made, turn_deg, setting = SCENES[name]
    small = [*common.SMALL_RING] if args.small else []
    program("rig", "ring", "--overwrite", "--out", folder / "ring.json", *small)
    rig = json.loads((folder / "ring.json").read_text())
    vertices, triangles = standing(made, turn_deg, rig["volume"]["radius"])
    if "floor" in setting:
        rig["floor"] = {"point": [0, 0, vertices[:, 2].min()], "normal": [0, 0, 1]}
        common.write_rig(folder / "ring.json", rig)
    common.write_ply(folder / "mesh.ply", vertices, triangles)
    program("simulate", "--overwrite", "--rig", folder / "ring.json", "--mesh", folder / "mesh.ply", "--out",
            folder / "exported", "--export-blender", "--projector-blur", 0.35, "--exposure", 0.6, "--samples", 1)
    blender = folder / "exported/blender"
    scene = json.loads((blender / "scene.json").read_text())
    # Depth of field of f/8 at 23 mm: 2.9 mm.
    scene |= {"samples": args.samples, "aperture": 2.9} | setting
    (blender / "scene.json").write_text(json.dumps(scene))
    wanted = json.dumps([scene, args.small])
    kept = folder / "traced"
    if not (kept / "stamp").exists() or (kept / "stamp").read_text() != wanted:
        with open(args.out / "blender.log", "a") as log:
            render(blender, log)
        shutil.rmtree(kept, ignore_errors=True)
        shutil.move(blender / "light", kept)
        (kept / "stamp").write_text(wanted)
    return kept


def main():
    args = common.arguments("path_traced", __doc__, samples=(128, 8))
    args.reconstruct, args.keep = "", True  # of heldout.measure()
    if not shutil.which("blender"):
        common.progress("path_traced: blender is missing: script/bootstrap --trace")
        raise SystemExit(77)  # a test that was skipped
    program = common.Program(args)
    rows = common.Rows(args.out / "results.csv", ["scene", "sensor"], COLUMNS, args.resume)
    for number, name in enumerate(SCENES):
        if args.small and name not in SMALL:
            continue
        folder = args.out / "work" / str(number)
        folder.mkdir(parents=True, exist_ok=True)
        missing = [sensor for sensor in SENSORS if not rows.has(scene=name, sensor=sensor)]
        if not missing:
            continue
        common.progress(f"path_traced: {name}")
        light = traced(args, program, folder, name)
        for sensor in missing:
            stated, options = SENSORS[sensor]
            rig = json.loads((folder / "ring.json").read_text())
            for camera in rig["cameras"]:
                camera.update(stated)
            taken = folder / f"sensor{list(SENSORS).index(sensor)}"
            taken.mkdir(exist_ok=True)
            common.write_rig(taken / "rig.json", rig)
            program("simulate", "--overwrite", "--rig", taken / "rig.json", "--mesh", folder / "mesh.ply", "--out",
                    taken / "scene", "--light", light, "--noise", "medium", "--seed", SEED, *options)
            figures = heldout.measure(args, program, taken / "scene", taken / "rig.json", taken / "scene/frames",
                                      taken / "made")
            if not figures:
                raise SystemExit(f"path_traced: no result of '{name}': see {args.out / 'commands.log'}")
            rows.add(scene=name, sensor=sensor, **{key: figures[key] for key in COLUMNS})
    table = [[row["scene"], row["sensor"], f"{100 * row['label_error']:.2f}", f"{row['line_recall']:.3f}",
              f"{row['distance_median_mm']:.3f}", f"{100 * row['share_above_2mm']:.3f}",
              f"{row['mesh_distance_median_mm']:.3f}", f"{100 * row['mesh_share_above_2mm']:.2f}",
              f"{row['completeness_1mm']:.3f}",
              f"{row['sigma_below_1']:.2f} / {row['mesh_sigma_below_1']:.2f}"] for row in rows.rows]
    common.print_table(args.out / "table.md", "Path-traced scenes",
                       ["scene", "sensor", "label error, %", "line recall", "points, median mm", "> 2 mm, %",
                        "mesh, median mm", "> 2 mm, %", "complete at 1 mm", "below one sigma, points / mesh"], table)


main()
