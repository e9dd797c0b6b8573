#!/usr/bin/env python3
"""How much a resting surface flickers: vertices of one frame's mesh.ply against the next frame's surface,
along their normals, over their sigma (python3-numpy).

    flicker.py RESULT 000003 000004 000005"""
import sys
from collections import defaultdict

import numpy as np

TYPES = {"float": "<f4", "float32": "<f4", "double": "<f8", "uchar": "u1", "uint8": "u1", "ushort": "<u2",
         "short": "<i2", "int": "<i4", "int32": "<i4", "uint": "<u4"}
CELL = 3.0      # of the search for neighbours, in the rig's unit: larger than an edge of the mesh
SAMPLES = 6000


def read_mesh(path):
    """Positions, normals, sigma and whether measured, of each vertex of a mesh of the program."""
    with open(path, "rb") as file:
        data = file.read()
    start = data.index(b"end_header\n") + len(b"end_header\n")
    counts, properties, element = {}, [], ""
    for line in data[:start].decode().splitlines():
        words = line.split()
        if words[0] == "element":
            element = words[1]
            counts[element] = int(words[2])
        elif words[0] == "property" and element == "vertex":
            properties.append((words[2], TYPES[words[1]]))
    vertices = np.frombuffer(data, dtype=properties, count=counts["vertex"], offset=start)
    faces = np.frombuffer(data, dtype=[("count", "u1"), ("vertices", "<i4", 3)], count=counts["face"],
                          offset=start + vertices.nbytes)["vertices"]
    x = np.stack([vertices[axis] for axis in "xyz"], 1).astype(float)
    normals = np.zeros_like(x)
    of_faces = np.cross(x[faces[:, 1]] - x[faces[:, 0]], x[faces[:, 2]] - x[faces[:, 0]])
    for k in range(3):
        np.add.at(normals, faces[:, k], of_faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return x, normals, vertices["sigma"], vertices["confidence"] > 0


def changes(first, second):
    """Of some measured vertices, how far the second surface lies from the first, in sigmas."""
    x, normals, sigma, is_measured = first
    other, other_normals, _, _ = second
    cells = defaultdict(list)
    for i, cell in enumerate(map(tuple, np.floor(other / CELL).astype(int))):
        cells[cell].append(i)
    found = []
    for i in np.random.default_rng(0).choice(len(x), min(SAMPLES, len(x)), replace=False):
        if not is_measured[i]:
            continue
        a, b, c = np.floor(x[i] / CELL).astype(int)
        near = np.array([k for u in (-1, 0, 1) for v in (-1, 0, 1) for w in (-1, 0, 1)
                         for k in cells.get((a + u, b + v, c + w), ())], dtype=int)
        near = near[other_normals[near] @ normals[i] > 0.7]
        if len(near) == 0:
            continue
        nearest = near[np.argmin(((other[near] - x[i]) ** 2).sum(1))]
        found.append(other_normals[nearest] @ (other[nearest] - x[i]) / sigma[i])
    return np.array(found)


def root_mean_square(found):
    """Of changes in sigmas; what is beyond five counts as five."""
    return float(np.sqrt(np.mean(np.clip(found, -5, 5) ** 2)))


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    result, frames = sys.argv[1], sys.argv[2:]
    for one, next_one in zip(frames, frames[1:]):
        moved = changes(read_mesh(f"{result}/{one}/mesh.ply"), read_mesh(f"{result}/{next_one}/mesh.ply"))
        print(f"{one} to {next_one}: rms {root_mean_square(moved):.3f} sigma, "
              f"68 % below {np.percentile(np.abs(moved), 68.3):.3f}")
