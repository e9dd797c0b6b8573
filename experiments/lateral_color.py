#!/usr/bin/python3
"""Lateral colour: red light half a pixel to one side, blue light half a pixel to the other.

Every camera and projector of a ring of six and six has red and blue displaced in a direction of its own, opposite to
each other, and enlarged by 0.02 % more and less. The bunny is reconstructed with rigs that state nothing of it, that
state the truth, and that state what `calibrate` found in one Gray-code capture in colour (a heap of balls that fills the
volume, K and poses of the cameras given).
"""

import hashlib
import json
import shutil

import numpy as np

import calibration
import common

FIGURES = ["distance_median_mm", "distance_p90_mm", "label_error", "line_recall", "mesh_distance_median_mm"]


def displaced(rig, shift_px, seed=5):
    """The rig with lateral colour, and that of every device."""
    random = np.random.default_rng(seed)
    rig = json.loads(json.dumps(rig))
    for d in rig["cameras"] + rig["projectors"]:
        angle = random.uniform(0, 2 * np.pi)
        shift = shift_px * np.array([np.cos(angle), np.sin(angle)])
        scale = 4e-4 * shift_px
        d["color_registration"] = {"red": {"shift_px": shift.tolist(), "scale": 1 + scale},
                                   "blue": {"shift_px": (-shift).tolist(), "scale": 1 - scale}}
    return rig


def with_keys(rig, source, keys):
    """`rig` with what `source` says of colour."""
    rig = json.loads(json.dumps(rig))
    for group in ("cameras", "projectors"):
        for to, d in zip(rig[group], source[group]):
            for key in keys:
                to.pop(key, None)
                if key in d:
                    to[key] = d[key]
    return rig


def errors(truth, report):
    """Estimated displacements against the truth, px and deviations."""
    off, z = [], []
    for d, found in zip(truth["cameras"] + truth["projectors"], report["color"]["registration"]["devices"]):
        for color in ("red", "blue", "green"):
            true = d["color_registration"].get(color, {"shift_px": [0, 0], "scale": 1})
            e = np.subtract(found[color]["shift_px"], true["shift_px"])
            off.extend(e)
            z.extend(e / np.asarray(found[color]["shift_sigma_px"]))
            z.append((found[color]["scale"] - true["scale"]) / found[color]["scale_sigma"])
    return np.abs(off), np.abs(z)


def origin(rig, mesh, options):
    """Tells scenes apart by all that they are rendered from but the simulator."""
    return hashlib.sha256(rig.read_bytes() + mesh.read_bytes() + repr(options).encode()).hexdigest()


def main():
    args = common.arguments("lateral_color", __doc__, shift=(0.5, 0.5), noise=("medium", "low"))
    program = common.Program(args)
    ring = common.SMALL_RING if args.small else []
    program("rig", "ring", "--overwrite", "--out", args.out / "plain.json", *ring, json_output=False)
    plain = json.loads((args.out / "plain.json").read_text())
    truth = displaced(plain, args.shift)
    common.write_rig(args.out / "truth.json", truth)

    def render(name, rig, mesh, *more):
        out, options = args.out / name, ["--noise", args.noise, *more]
        wanted = origin(rig, mesh, options)
        if not (out / "done").exists() or (out / "done").read_text() != wanted:
            shutil.rmtree(out, ignore_errors=True)
            program("simulate", "--rig", rig, "--mesh", mesh, "--out", out, *options)
            (out / "done").write_text(wanted)
        return out

    bunny = (common.BUNNY, "--up", "y", "--fit")
    scenes = {"shifted": render("scene_shifted", args.out / "truth.json", *bunny)}
    if not args.small:
        scenes["plain"] = render("scene_plain", args.out / "plain.json", *bunny)
    calibration.RADIUS = 0.97 * plain["volume"]["radius"]
    common.write_ply(args.out / "heap.ply", *calibration.heap(0))
    captures = render("captures", args.out / "truth.json", args.out / "heap.ply", "--gray-code", "--color-captures",
                      "--samples", 1 if args.small else 2)
    # Poses of the cameras give the frame.
    devices = with_keys(plain, {"cameras": plain["cameras"], "projectors": [{}] * len(plain["projectors"])},
                        ["K", "distortion", "R", "t"])
    common.write_rig(args.out / "devices.json", devices)
    program("calibrate", "--captures", captures / "captures", "--devices", args.out / "devices.json", "--out",
            args.out / "found/rig.json", "--overwrite", json_output=False)
    found = json.loads((args.out / "found/rig.json").read_text())
    report = json.loads((args.out / "found/calibration.json").read_text())
    off, z = errors(truth, report)
    print(f"displacements: error {np.median(off):.3f} px in the median, {off.max():.3f} at most; over their deviations "
          f"{np.sqrt(np.mean(z**2)):.2f} (RMS), {z.max():.1f} at most\n")

    estimated = ["color_registration", "color_matrix"]
    cases = [("none displaced", "plain", plain), ("unknown", "shifted", plain), ("known", "shifted", truth),
             ("estimated, true poses", "shifted", with_keys(plain, found, estimated)),
             ("all calibrated", "shifted", found)]
    if args.small:  # of two cameras, whose poses do not fix the frame
        cases = [cases[1], cases[3]]
    rows = []
    for name, scene, rig in cases:
        path = common.write_rig(args.out / "used.json", rig)
        out = args.out / "out" / name.replace(" ", "_").replace(",", "")
        shutil.rmtree(out, ignore_errors=True)  # of another program, perhaps
        program("reconstruct", "--rig", path, "--frames", scenes[scene] / "frames", "--out", out, "--no-pictures")
        mesh = scenes[scene] / "truth/mesh.ply"
        figures = program("evaluate", "--truth", mesh, "--rig", path, "--result", out / "000000")
        rows.append([name, *[common.number(figures.get(k), 4) for k in FIGURES]])
    common.print_table(args.out / "table.md", f"Red and blue displaced by {args.shift} px", ["colours", *FIGURES], rows)


if __name__ == "__main__":
    main()
