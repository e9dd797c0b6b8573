#!/usr/bin/python3
"""Gray-code captures that went wrong, and what calibrate says of each.

Three cameras and three projectors of 640 x 480 and 640 x 512 px, K of the cameras given, three captures of heaps of balls. Every
row is one mistake, of a person, a driver or a projector's menu.
"""

import json
import os
import shutil

import cv2

import common
import shapes

import numpy as np

SEED = 5
MOVE = [0.6, 0.8, 0]  # mm
COLUMN_BITS, ROW_BITS = 10, 9


def heap(seed):
    """Overlapping balls in the middle of the volume."""
    random = np.random.default_rng(seed)
    parts = []
    for _ in range(14):
        centre = random.normal(size=3)
        centre *= 100 * random.random() ** (1 / 3) / np.linalg.norm(centre)
        parts.append(shapes.capsule(centre, centre + [0.01, 0, 0], random.uniform(25, 50), around=32, along=1, cap=16))
    return shapes.joined(parts)


def simulated(program, rig, capture, mesh, out):
    path = common.write_rig(out.with_suffix(".json"), rig)
    common.write_ply(out.with_suffix(".ply"), *mesh)
    program("simulate", "--overwrite", "--rig", path, "--mesh", out.with_suffix(".ply"), "--out", out, "--gray-code", "--noise",
            "low", "--seed", SEED + capture)


def rendered(program, folder, scale):
    """The right captures, and their rig; `scale`: of the pixels' number along an axis."""
    sizes = {"camera-width": 640, "camera-height": 480, "camera-focal-px": 1150,
             "projector-width": 640, "projector-height": 512, "projector-focal-px": 1215}
    program("rig", "ring", "--overwrite", "--out", folder / "ring.json", "--cameras", 3, "--projectors", 3, "--arc-deg", 100,
            *[word for name, size in sizes.items() for word in ("--" + name, int(scale * size))])
    rig = json.loads((folder / "ring.json").read_text())
    for capture in range(3):
        simulated(program, rig, capture, heap(SEED + capture), folder / f"right{capture}")
    return rig


def with_projector(rig, name):
    """The rig with this projector alone."""
    return {**rig, "projectors": [p for p in rig["projectors"] if p["name"] == name]}


def in_mirror(rig, mesh):
    """Rig and mesh the other way round: what devices show and see is mirrored, since their centres are in the middle."""
    across = np.diag([-1.0, 1.0, 1.0])
    turned = {kind: [{**d, "R": (across @ d["R"] @ across).tolist(), "t": (across @ d["t"]).tolist()} for d in rig[kind]]
              for kind in ("cameras", "projectors")}
    vertices, triangles = mesh
    return {**rig, **turned}, (vertices @ across, triangles[:, ::-1])


def rendered_wrong(program, folder, rig):
    """Captures that no change of the right ones makes."""
    for capture in range(3):
        mirrored, mesh = in_mirror(with_projector(rig, "proj1"), heap(SEED + capture))
        simulated(program, mirrored, capture, mesh, folder / f"mirrored{capture}")
    vertices, triangles = heap(SEED + 1)
    simulated(program, with_projector(rig, "proj2"), 1, (vertices + MOVE, triangles), folder / "moved1")


def described(rig):
    """The devices as their user describes them."""
    rig = json.loads(json.dumps(rig))
    for camera in rig["cameras"]:
        for key in ("distortion", "R", "t"):
            del camera[key]
    for projector in rig["projectors"]:
        for key in ("K", "distortion", "R", "t"):
            del projector[key]
    rig.pop("volume", None)
    return rig


class Captures:
    """A copy of the right ones, and the devices, to be spoilt."""

    def __init__(self, folder, rendered, devices):
        self.folder, self.rendered, self.devices = folder, rendered, devices
        shutil.rmtree(folder, ignore_errors=True)
        for capture in range(3):
            shutil.copytree(rendered / f"right{capture}/captures", folder / f"pose{capture}")

    def pairs(self, capture=None, projector=None, camera=None):
        for pair in sorted(self.folder.glob("pose*/*/*")):
            if capture in (None, int(pair.parts[-3][4:])) and projector in (None, pair.parts[-2]) and \
                    camera in (None, pair.parts[-1]):
                yield pair

    def change(self, change, **which):
        for pair in self.pairs(**which):
            for path in sorted(pair.glob("*.png")):
                cv2.imwrite(str(path), change(cv2.imread(str(path), -1)))

    def reorder(self, file_of, **which):
        """Picture i of the order that is asked for is found as picture file_of(i)."""
        for pair in self.pairs(**which):
            paths = sorted(pair.glob("*.png"))
            contents = [path.read_bytes() for path in paths]
            for i, path in enumerate(paths):
                path.write_bytes(contents[file_of(i, len(paths))])

    def take(self, scene, capture, projector):
        """The pictures of a projector are those of another scene."""
        shutil.copytree(self.rendered / scene / "captures" / projector, self.folder / f"pose{capture}" / projector,
                        dirs_exist_ok=True)

    def exchange(self, one, other, capture):
        for a, b in zip(self.pairs(capture, **one), self.pairs(capture, **other)):
            os.rename(a, self.folder / "aside")
            os.rename(b, a)
            os.rename(self.folder / "aside", b)


def mirrored_projector(captures):
    """The scene in a mirror, in mirrored pictures: only the panel's columns go from right to left."""
    for capture in range(3):
        captures.take(f"mirrored{capture}", capture, "proj1")
    captures.change(lambda x: x[:, ::-1], projector="proj1")


def rows_first(captures, **which):
    order = [0, 1, *range(2 + 2 * COLUMN_BITS, 2 + 2 * (COLUMN_BITS + ROW_BITS)), *range(2, 2 + 2 * COLUMN_BITS)]
    captures.reorder(lambda i, count: order[i], **which)


def scaled_k(factor):
    def change(captures):
        for camera in captures.devices["cameras"]:
            camera["K"][0][0] *= factor
            camera["K"][1][1] *= factor
    return change


MISTAKES = {
    "none": lambda c: None,
    "a camera's pictures are mirrored": lambda c: c.change(lambda x: x[:, ::-1], camera="cam1"),
    "those of all cameras are": lambda c: c.change(lambda x: x[:, ::-1]),
    "a projector mirrors its picture": mirrored_projector,
    "a camera hangs upside down": lambda c: c.change(lambda x: x[::-1, ::-1], camera="cam1"),
    "each picture is one late": lambda c: c.reorder(lambda i, count: max(i - 1, 0)),
    "black before white": lambda c: c.reorder(lambda i, count: 1 - i if i < 2 else i),
    "rows before columns": rows_first,
    "rows before columns in one capture": lambda c: rows_first(c, capture=1),
    "two bits of a projector exchanged": lambda c: c.reorder(lambda i, n: {6: 8, 7: 9, 8: 6, 9: 7}.get(i, i), projector="proj1"),
    "one pair is one late from picture 20 on": lambda c: c.reorder(lambda i, n: i - (i > 20), capture=1, projector="proj1",
                                                                   camera="cam1"),
    "two cameras' folders exchanged in one capture": lambda c: c.exchange({"camera": "cam0"}, {"camera": "cam1"}, 1),
    "all captures are the first": lambda c: [shutil.copytree(c.folder / "pose0", c.folder / f"pose{k}", dirs_exist_ok=True)
                                             for k in (1, 2)],
    "the object moved by 1 mm while one capture was taken": lambda c: c.take("moved1", 1, "proj2"),
    "a picture is missing": lambda c: (c.folder / "pose1/proj1/cam1/017.png").unlink(),
    "a twentieth of the exposure": lambda c: c.change(lambda x: (x * 0.05).astype(x.dtype)),
    "three times the exposure": lambda c: c.change(lambda x: np.clip(x * 3.0, 0, 255).astype(x.dtype)),
    "JPEG 85": lambda c: c.change(lambda x: cv2.imdecode(cv2.imencode(".jpg", x, [cv2.IMWRITE_JPEG_QUALITY, 85])[1], -1)),
    "gamma 2.2": lambda c: c.change(lambda x: (255 * (x / 255.0) ** (1 / 2.2) + 0.5).astype(x.dtype)),
    "K a tenth too large": scaled_k(1.1),
    "K of pictures twice as large": scaled_k(2),
    "K in millimetres": scaled_k(1 / 200),
}
SMALL = ["none", "each picture is one late", "K in millimetres"]
NAMED = {"each picture is one late": "late", "a camera's pictures are mirrored": "are mirrored",
         "two cameras' folders exchanged in one capture": "are swapped", "all captures are the first": "the same pictures",
         "the object moved by 1 mm while one capture was taken": "moved while"}


def judged(args, program, captures):
    """Exit code's word, verdict and the first reason."""
    devices = captures.folder / "devices.json"
    devices.write_text(json.dumps(captures.devices))
    poses = [word for k in range(3) for word in ("--captures", captures.folder / f"pose{k}")]
    found = captures.folder / "found"
    program("calibrate", *poses, "--devices", devices, "--known-distance", "cam0", "cam1", 500, "--out", found / "rig.json",
            may_fail=True, may_crash=True)
    report = found / "calibration.json"
    if not report.exists():
        return "refused", program.complaint.strip().split("\n")[-1].replace(str(captures.folder) + "/", "")
    report = json.loads(report.read_text())
    reasons = [r["what"] if isinstance(r, dict) else r for r in report["reasons"]]
    first = reasons[0] if reasons and report["verdict"] != "good" else ""
    return report["verdict"], first.replace(str(captures.folder) + "/", "")


def main():
    args = common.arguments("capture_mistakes", __doc__)
    program = common.Program(args)
    rows = common.Rows(args.out / "results.csv", ["mistake"], ["verdict", "reason"], args.resume)
    rig = rendered(program, args.out, 0.5 if args.small else 1)
    if not args.small:
        rendered_wrong(program, args.out, rig)
    for name, spoil in MISTAKES.items():
        if rows.has(mistake=name) or (args.small and name not in SMALL):
            continue
        common.progress(f"capture_mistakes: {name}")
        captures = Captures(args.out / "spoilt", args.out, described(rig))
        spoil(captures)
        verdict, reason = judged(args, program, captures)
        rows.add(mistake=name, verdict=verdict, reason=reason)
    common.print_table(args.out / "table.md", "Captures that went wrong", ["mistake", "verdict", "the first thing it says"],
                       [[row["mistake"], row["verdict"], row["reason"] or "-"] for row in rows.rows])
    said = {row["mistake"]: row for row in rows.rows}
    if said["none"]["verdict"] != "good":
        raise SystemExit("capture_mistakes: right captures are not good")
    for name, word in NAMED.items():
        if name in said and word not in said[name]["reason"]:
            raise SystemExit(f"capture_mistakes: {name}: not named")


if __name__ == "__main__":
    main()
