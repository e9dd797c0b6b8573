#!/usr/bin/python3
"""Wide and defocused lines: how many pieces a line falls into, and how much of it is found.

A ball of 200 mm before one projector and one camera, two colours, order 4, 1280 x 960. The line widths of the pattern and
the defocus of both devices vary. The true lines in the picture follow from the ball itself.
"""

import json
import math

import numpy as np

import common

RADIUS = 100.0
# name: pitch and line width of the pattern, defocus (Gaussian) of projector and camera, px; noise
SCENES = {"6 px": (17, 6, 2, 1, "medium"), "8 px, defocused": (17, 8, 4, 2, "medium"),
          "14 px, defocused": (34, 14, 5, 2, "medium"), "16 px, noisy": (34, 16, 2, 1, "high"),
          "30 px, defocused": (60, 30, 6, 2, "medium")}
COLUMNS = ["lines", "spacing_px", "pieces", "found", "labeled_points", "wrong_points"]
NEAR_PX = 3.0  # of a true line: a curve point is of it
LEAST_POINTS = 10  # of a curve: it is a piece of the line


def ball():
    """Triangles of .05 mm from the ball at most."""
    rings, sectors = 120, 240
    a = np.pi * np.arange(rings + 1)[:, None] / rings
    b = 2 * np.pi * np.arange(sectors)[None] / sectors
    vertices = RADIUS * np.stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b),
                                  np.cos(a) + 0 * b], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rings), np.arange(sectors), indexing="ij")
    corner = [i * sectors + j, i * sectors + (j + 1) % sectors,
              (i + 1) * sectors + j, (i + 1) * sectors + (j + 1) % sectors]
    corner = [c.ravel() for c in corner]
    return vertices, np.concatenate([np.stack([corner[0], corner[2], corner[3]], 1),
                                     np.stack([corner[0], corner[3], corner[1]], 1)])


def rig_of(pitch, line, azimuths=(0,)):
    cameras = [common.device(f"cam{k}", (1280, 960), 2300, common.on_sphere(azimuth, 0, 1000))
               for k, azimuth in enumerate(azimuths)]
    projector = common.device("proj0", (1024, 768), 2000, common.on_sphere(20, 6, 1000))
    projector["pattern"] = {**common.pattern("vertical", pitch, line), "order": 4}
    return common.rig_of(cameras, [projector], 1.15 * RADIUS)


def line_map(camera, projector):
    """Number of the projector's line at every pixel of the camera, in parts; NaN beside the lit ball."""
    v, u = np.mgrid[0:camera["height"], 0:camera["width"]].astype(float)
    ray = common.rays(camera, np.stack([u, v], -1).reshape(-1, 2))
    eye = common.center_of(camera)
    along = ray @ eye
    root = along**2 - (eye @ eye - RADIUS**2)
    point = eye + (-along - np.sqrt(np.where(root > 0, root, np.nan)))[:, None] * ray
    normal = point / RADIUS
    light = common.center_of(projector) - point
    is_lit = (light * normal).sum(1) > 0.15 * np.linalg.norm(light, axis=1)
    is_seen = -(ray * normal).sum(1) > 0.2
    lit = common.project(projector, point)
    is_shown = (np.abs(lit / [projector["width"], projector["height"]] - 0.5) < 0.5).all(1)
    of = projector["pattern"]
    line = (lit[:, 0] - of["offset_px"]) / of["pitch_px"]
    return np.where(is_lit & is_seen & is_shown, line, np.nan).reshape(u.shape)


def figures(lines, curves):
    """Of the true lines in the picture: pieces, and the share of their pixels that a curve has."""
    slope = np.hypot(*np.gradient(lines))
    u, v = (np.clip(np.rint(curves[k]).astype(int), 0, n - 1) for k, n in zip("uv", lines.shape[::-1]))
    of_line = np.rint(lines[v, u])
    is_on = np.abs(lines[v, u] - of_line) < NEAR_PX * slope[v, u]
    count, pieces, length, found = 0, 0, 0, 0
    for line in np.unique(np.rint(lines[np.isfinite(lines)])):
        y, x = np.nonzero((lines[:, :-1] <= line) & (lines[:, 1:] > line) |
                          (lines[:, :-1] > line) & (lines[:, 1:] <= line))
        if len(y) < 2 * LEAST_POINTS:
            continue
        mine = is_on & (of_line == line)
        has = np.zeros(lines.shape, bool)
        for dy in range(-2, 3):
            for dx in range(-2, 3):
                has[np.clip(v[mine] + dy, 0, len(has) - 1), np.clip(u[mine] + dx, 0, has.shape[1] - 1)] = True
        ids, points = np.unique(curves["curve"][mine], return_counts=True)
        whole = [np.count_nonzero(curves["curve"] == i) for i in ids]
        count += 1
        pieces += np.count_nonzero((points >= LEAST_POINTS) & (2 * points > whole))
        length += len(y)
        found += np.count_nonzero(has[y, x])
    is_labeled = curves["state"] == 0
    # Of labelled points that lie on the ball in both pictures.
    wrong = is_labeled & (np.abs(curves["line"] - lines[v, u]) > 0.5)
    return {"lines": count, "spacing_px": float(np.nanmedian(1 / slope[v, u])), "pieces": pieces,
            "found": found / max(length, 1), "labeled_points": int(is_labeled.sum()), "wrong_points": int(wrong.sum())}


def main():
    args = common.arguments("wide_lines", __doc__)
    program = common.Program(args)
    rows = common.Rows(args.out / "results.csv", ["scene"], COLUMNS, args.resume)
    common.write_ply(args.out / "ball.ply", *ball())
    for name, (pitch, line, blur, camera_blur, noise) in SCENES.items():
        if rows.has(scene=name) or (args.small and name != "14 px, defocused"):
            continue
        folder = args.out / name.replace(" ", "_").replace(",", "")
        common.write_rig(folder / "rig.json", rig_of(pitch, line))
        program("simulate", "--rig", folder / "rig.json", "--mesh", args.out / "ball.ply", "--out", folder / "scene",
                "--overwrite", "--noise", noise, "--projector-blur", blur, "--blur", camera_blur)
        program("reconstruct", "--rig", folder / "scene/rig.json", "--frames", folder / "scene/frames",
                "--out", folder / "result", "--no-mesh", "--no-pictures", "--overwrite")
        rig = json.loads((folder / "rig.json").read_text())
        curves, _ = common.read_ply(folder / "result/000000/curves.ply")
        rows.add(scene=name, **figures(line_map(rig["cameras"][0], rig["projectors"][0]), curves))
    print("| lines in the picture | lines | spacing, px | pieces | found | points labelled | of them wrong |")
    print("|---|---|---|---|---|---|---|")
    for row in rows.rows:
        found = row["found"] if row["found"] != "" else math.nan
        print(f"| {row['scene']} | {row['lines']} | {float(row['spacing_px']):.0f} | {row['pieces']} | {float(found):.3f} | "
              f"{row['labeled_points']} | {row['wrong_points']} |")


if __name__ == "__main__":
    main()
