"""What the experiments share: calling the program, rigs, files, tables, plots.

Lengths are mm, pixel centres lie at integer coordinates, x_device = R x_world + t (docs/conventions.md).
"""

import argparse
import csv
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
BUNNY = Path("/usr/share/glmark2/models/bunny.obj")  # of Debian's glmark2-data


# ---- the script -----------------------------------------------------------------------------------


def arguments(name, description, parents=(), **numbers):
    """Command line of an experiment; `numbers` are further options: name=(default, small default),
    `parents` parsers of others."""
    parser = argparse.ArgumentParser(description=description, parents=parents)
    parser.add_argument("--small", action="store_true", help="a setting of less than a minute")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "experiments" / name)
    parser.add_argument("--program", type=Path, default=ROOT / "build/release/pencilscan")
    parser.add_argument("--threads", type=int, default=0, help="of the program; 0: all cores")
    parser.add_argument("--resume", action="store_true", help="keep the rows of an earlier run")
    for option, (default, small) in numbers.items():
        parser.add_argument("--" + option.replace("_", "-"), type=type(default),
                            help=f"default {default}, with --small {small}")
    args = parser.parse_args()
    for option, (default, small) in numbers.items():
        if getattr(args, option) is None:
            setattr(args, option, small if args.small else default)
    if not args.program.exists():
        parser.error(f"{args.program} is missing: script/build")
    args.out.mkdir(parents=True, exist_ok=True)
    title, _, text = description.strip().partition("\n")
    about = {"name": name, "title": title.rstrip("."), "text": " ".join(text.split()),
             "setting": "small" if args.small else "full"}
    (args.out / "experiment.json").write_text(json.dumps(about, indent=1) + "\n")
    return args


class Program:
    """pencilscan, one command a call; figures come back as a dict, None where a stage failed."""

    def __init__(self, args, memory_gb=0):
        self.path = args.program.resolve()
        self.threads = args.threads
        self.memory = int(memory_gb * 2**30)  # address space that a command may take; 0: any
        self.log = open(args.out / "commands.log", "a")
        self.complaint = ""  # of the last command that failed and might

    def _limit(self):
        if self.memory:
            resource.setrlimit(resource.RLIMIT_AS, (self.memory, self.memory))

    def __call__(self, *words, may_fail=False, may_crash=False, json_output=True):
        command = [str(self.path), *[str(w) for w in words], "--threads", str(self.threads)]
        with tempfile.TemporaryDirectory() as folder:
            figures = Path(folder) / "figures.json"
            if json_output:
                command += ["--json", str(figures)]
            print(" ".join(command), file=self.log, flush=True)
            run = subprocess.run(command, capture_output=True, text=True, preexec_fn=self._limit)
            if (run.returncode == 1 and may_fail) or (run.returncode != 0 and may_crash):
                print(f"exit {run.returncode}: {run.stderr[-300:]}", file=self.log, flush=True)
                self.complaint = run.stderr
                return None
            if run.returncode != 0:
                raise SystemExit(f"{' '.join(command)}\n{run.stderr}")
            return json.loads(figures.read_text()) if json_output else {}


class Rows:
    """A table that grows row by row in a CSV file; with `resume` those of an earlier run count."""

    def __init__(self, path, keys, values, resume=False):
        self.path, self.keys, self.columns = Path(path), keys, [*keys, *values]
        self.rows = []
        if resume and self.path.exists():
            with open(self.path) as file:
                self.rows = [{c: _parsed(v) for c, v in row.items()} for row in csv.DictReader(file)]
        self._write()

    def _write(self):
        part = self.path.with_name(self.path.name + ".part")
        with open(part, "w", newline="") as file:
            writer = csv.DictWriter(file, self.columns)
            writer.writeheader()
            writer.writerows(self.rows)
        os.replace(part, self.path)

    def has(self, **key):
        return any(all(row[k] == v for k, v in key.items()) for row in self.rows)

    def add(self, **row):
        """Replaces the row of the same keys, or appends; absent values stay empty."""
        full = {c: row.get(c, "") for c in self.columns}
        full = {c: "" if v is None else v for c, v in full.items()}
        self.rows = [r for r in self.rows if any(r[k] != full[k] for k in self.keys)]
        self.rows.append(full)
        self._write()

    def select(self, **key):
        return [row for row in self.rows if all(row[k] == v for k, v in key.items())]

    def column(self, value, **key):
        """The values of a column as an array, NaN where there is none."""
        return np.array([row[value] if row[value] != "" else math.nan for row in self.select(**key)],
                        dtype=float)


def _parsed(text):
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


def progress(text):
    print(text, file=sys.stderr, flush=True)


# ---- files ----------------------------------------------------------------------------------------

_TYPES = {"char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2", "int": "<i4", "uint": "<u4",
          "float": "<f4", "double": "<f8"}


def read_ply(path):
    """Vertices as a structured array and triangles as an N x 3 array of a binary PLY file."""
    data = Path(path).read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    elements = []
    for line in data[:end].decode().splitlines():
        word = line.split()
        if word[0] == "element":
            elements.append((word[1], int(word[2]), []))
        elif word[0] == "property" and word[1] == "list":
            elements[-1][2].append([("count", _TYPES[word[2]]), (word[4], _TYPES[word[3]], (3,))])
        elif word[0] == "property":
            elements[-1][2].append([(word[2], _TYPES[word[1]])])
    vertices, triangles = None, np.zeros((0, 3), int)
    for name, count, properties in elements:
        kind = np.dtype([field for fields in properties for field in fields])
        array = np.frombuffer(data, kind, count, end)
        end += kind.itemsize * count
        if name == "vertex":
            vertices = array
        elif name == "face":
            triangles = array[array.dtype.names[1]].astype(int)
    return vertices, triangles


def positions(vertices):
    return np.stack([vertices["x"], vertices["y"], vertices["z"]], 1).astype(float)


def write_ply(path, vertices, triangles):
    """A mesh: N x 3 vertices in mm, M x 3 indices."""
    faces = np.zeros(len(triangles), [("count", "u1"), ("vertex_indices", "<i4", (3,))])
    faces["count"], faces["vertex_indices"] = 3, triangles
    header = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
              "property float x\nproperty float y\nproperty float z\n"
              f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n")
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_bytes(header.encode() + np.asarray(vertices, "<f4").tobytes() + faces.tobytes())


# ---- rigs -----------------------------------------------------------------------------------------


def on_sphere(azimuth_deg, elevation_deg, distance):
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return distance * np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])


def device(name, size, focal_px, eye, target=(0, 0, 0)):
    """A pinhole that looks from `eye` at `target`, world z up."""
    forward = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(forward, right), forward])
    width, height = size
    return {"name": name, "width": width, "height": height,
            "K": [[focal_px, 0, (width - 1) / 2], [0, focal_px, (height - 1) / 2], [0, 0, 1]],
            "distortion": [0, 0, 0, 0, 0], "R": R.tolist(), "t": (-R @ np.asarray(eye)).tolist()}


def pattern(orientation, pitch_px, width_px=None, colors=None):
    """Lines of the paper: blue and cyan vertical ones, red and yellow horizontal ones."""
    colors = colors or (["blue", "cyan"] if orientation == "vertical" else ["red", "yellow"])
    return {"orientation": orientation, "colors": colors, "alphabet": 2, "order": 3,
            "pitch_px": pitch_px, "line_width_px": width_px or pitch_px / 3, "offset_px": pitch_px / 2}


def rig_of(cameras, projectors, radius):
    return {"format": "rig/1", "unit": "mm", "cameras": cameras, "projectors": projectors,
            "volume": {"center": [0, 0, 0], "radius": radius}}


def write_rig(path, rig):
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(json.dumps(rig, indent=1))
    return path


def project(d, points):
    """Pixels of N x 3 world points (no lens distortion)."""
    x = points @ np.asarray(d["R"]).T + np.asarray(d["t"])
    x = x @ np.asarray(d["K"]).T
    return x[:, :2] / x[:, 2:]


def center_of(d):
    return -np.asarray(d["R"]).T @ np.asarray(d["t"])


def rays(d, pixels):
    """Unit directions in the world of N x 2 pixels (no lens distortion)."""
    x = np.c_[pixels, np.ones(len(pixels))] @ np.linalg.inv(d["K"]).T @ np.asarray(d["R"])
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def _rotation(w):
    angle = np.linalg.norm(w)
    if angle == 0:
        return np.eye(3)
    x, y, z = w / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def with_calibration_error(rig, error_px, seed):
    """Every device turned and shifted at random, each of both moving the picture of the volume by
    error_px / sqrt(2) (root mean square): `error_px` together. The same seed gives the same
    directions at every size."""
    random = np.random.default_rng(seed)
    probe = np.random.default_rng(0).normal(size=(400, 3))
    probe *= 0.7 * rig["volume"]["radius"] / np.linalg.norm(probe, axis=1, keepdims=True)
    result = json.loads(json.dumps(rig))
    for d in result["cameras"] + result["projectors"]:
        before = project(d, probe)
        R, t = np.asarray(d["R"]), np.asarray(d["t"])
        turn, shift = random.normal(size=3), random.normal(size=3)

        def moved(a, b):
            return {**d, "R": (_rotation(a * turn) @ R).tolist(),
                    "t": (_rotation(a * turn) @ t + b * shift).tolist()}

        def effect(a, b):
            off = project(moved(a, b), probe) - before
            return math.sqrt(np.mean(np.sum(off**2, 1)))

        a = 1e-5 / effect(1e-5, 0) * error_px / math.sqrt(2)
        b = 1e-2 / effect(0, 1e-2) * error_px / math.sqrt(2)
        d.update(moved(a, b))
    return result


# ---- results --------------------------------------------------------------------------------------


def number(value, digits=3):
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "-"
    return f"{value:.{digits}f}"


def spread(values, digits=3):
    """Median and quartiles of the finite values, as text."""
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return "-"
    low, middle, high = np.percentile(values, [25, 50, 75])
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def print_table(path, title, header, rows):
    """A Markdown table, to stdout and to a file."""
    lines = ["| " + " | ".join(map(str, row)) + " |" for row in (header, *rows)]
    lines.insert(1, "|" + "---|" * len(header))
    text = f"{title}\n\n" + "\n".join(lines) + "\n"
    Path(path).write_text(text)
    print(text)


def plots():
    """matplotlib without a display, with one style for all plots."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    plt.rcParams.update({"figure.dpi": 110, "font.size": 8, "axes.grid": True, "grid.alpha": 0.3,
                         "axes.spines.top": False, "axes.spines.right": False,
                         "svg.hashsalt": "pencilscan", "svg.fonttype": "none", "savefig.bbox": "tight"})
    return plt


# Options of `rig ring` for a setting that takes seconds.
SMALL_RING = ["--cameras", 2, "--projectors", 2, "--arc-deg", 90, "--camera-width", 640,
              "--camera-height", 480, "--camera-focal-px", 1150, "--pitch-px", 20]

METHOD_COLORS = {"linear": "tab:red", "multiview": "tab:orange", "joint": "tab:blue",
                 "single-projector": "tab:green", "surface": "navy", "scan": "0.4"}
