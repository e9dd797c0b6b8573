#!/usr/bin/python3
"""Fig. 8 of the paper: a moving, deforming object, one mesh per frame from one picture per camera.

Six cameras and six projectors; with --half 1 cameras of 640x480 and 18 px pitch, a fifth of the time. A
bunny turns, shifts and breathes; beside it a ball stands still. Accuracy and completeness over time, a
contact sheet, an animated picture, and the flicker of what does not move.
"""

import math
import shutil

import numpy as np

import common
import shapes
import sweeps

FIGURES = ["label_error", "line_recall", "distance_median_mm", "distance_p90_mm", "completeness_1mm",
           "f_score_1mm"]
BALL = (np.array([20.0, 105.0, -60.0]), 28.0)


def moment(frame):
    """Mesh of one frame: the bunny turned 3 degrees and shifted 1 mm per frame, its waist breathing,
    and the ball."""
    vertices, triangles = sweeps.bunny(115)
    phase = 2 * math.pi * frame / 15
    vertices = vertices * [1, 1, 1 + 0.06 * math.sin(phase)]
    vertices[:, 0] += 0.002 * vertices[:, 2] ** 2 * 0.3 * math.sin(phase)
    a = math.radians(3 * frame)
    turn = np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
    vertices = vertices @ turn.T + [0, -45 - 1.0 * frame + 15, 0]
    center, radius = BALL
    ball = shapes.capsule(center - [0, 0, 0.01], center + [0, 0, 0.01], radius, around=64, cap=24)
    return shapes.joined([(vertices, triangles), ball])


def flicker(path, previous):
    """RMS change of the still ball's radius between two frames, on a fixed grid of directions, mm;
    and the radii of this frame."""
    vertices, _ = common.read_ply(path)
    off = common.positions(vertices) - BALL[0]
    distance = np.linalg.norm(off, axis=1)
    near = np.abs(distance - BALL[1]) < 2
    off, distance = off[near], distance[near]
    longitude = np.floor((np.arctan2(off[:, 1], off[:, 0]) + math.pi) / (2 * math.pi) * 36)
    height = np.floor(np.clip(off[:, 2] / distance * 0.5 + 0.5, 0, 0.999) * 18)
    cell = (longitude * 18 + height).astype(int)
    sums, counts = np.bincount(cell, distance, 700), np.bincount(cell, minlength=700)
    radii = np.where(counts >= 3, sums / np.maximum(counts, 1), np.nan)
    change = radii - previous if previous is not None else np.full(1, np.nan)
    change = change[np.isfinite(change)]
    return (float(np.sqrt(np.mean(change**2))) if len(change) else None), radii


def run(args):
    program = common.Program(args)
    rig = args.out / "rig.json"
    ring = ["--camera-width", 640, "--camera-height", 480, "--camera-focal-px", 1150, "--pitch-px", 18,
            "--line-width-px", 6] if args.half else []
    program("rig", "ring", "--overwrite", "--out", rig, *(common.SMALL_RING if args.small else ring))
    rows = common.Rows(args.out / "results.csv", ["frame"], [*FIGURES, "flicker_mm"], args.resume)
    pictures = args.out / "pictures"
    pictures.mkdir(exist_ok=True)
    radii = None
    for frame in range(args.frames):
        if rows.has(frame=frame):
            continue
        mesh, scene, out = args.out / "work/m.ply", args.out / "work/scene", args.out / "work/out"
        common.write_ply(mesh, *moment(frame))
        program("simulate", "--rig", rig, "--mesh", mesh, "--noise", "medium", "--out", scene,
                "--overwrite", "--seed", 1000 + frame, "--samples", 2)
        done = program("reconstruct", "--rig", rig, "--frames", scene / "frames", "--out", out,
                       "--overwrite", may_fail=True)
        if not done:
            rows.add(frame=frame)
            continue
        figures = program("evaluate", "--truth", scene / "truth/mesh.ply", "--rig", rig, "--result",
                          out / "000000")
        change, radii = flicker(out / "000000/mesh_measured.ply", radii)
        rows.add(frame=frame, flicker_mm=change, **{k: figures.get(k) for k in FIGURES})
        shutil.copy(out / "000000/pictures/shape.png", pictures / f"{frame:03d}_shape.png")
        shutil.copy(out / "000000/pictures/cam0.jpg", pictures / f"{frame:03d}_cam0.jpg")
        common.progress(f"fig8_sequence: frame {frame + 1} of {args.frames}")
    return rows


def report(args, rows):
    keys = [*FIGURES, "flicker_mm"]
    table = [[k, common.spread(rows.column(k), 4), common.number(float(np.nanmin(rows.column(k))), 4),
              common.number(float(np.nanmax(rows.column(k))), 4)]
             for k in keys if np.isfinite(rows.column(k)).any()]
    common.print_table(args.out / "table.md", f"{len(rows.rows)} frames",
                       ["", "median (quartiles)", "least", "most"], table)
    plt = common.plots()
    figure, axes = plt.subplots(1, 4, figsize=(11, 2.2))
    for axis, key in zip(axes, ["completeness_1mm", "distance_median_mm", "label_error", "flicker_mm"]):
        axis.plot(rows.column("frame"), rows.column(key), marker="o", ms=2, color="tab:blue")
        axis.set_xlabel("frame")
        axis.set_ylabel(key)
        axis.set_ylim(0, 1 if key == "completeness_1mm" else None)
    figure.tight_layout()
    figure.savefig(args.out / "fig8_time.svg", metadata={"Date": None})
    animate(args)


def animate(args):
    """Captured frame above the shape: as a contact sheet of some frames, and as an animation."""
    from PIL import Image
    shapes_, frames = [sorted((args.out / "pictures").glob(p)) for p in ("*_shape.png", "*_cam0.jpg")]
    cells = []
    for seen, shape in zip(frames, shapes_):
        shape = Image.open(shape).convert("RGB")
        view = shape.crop((0, 0, shape.width // 3, shape.height // 2))
        view.thumbnail((240, 240))
        cell = Image.new("RGB", (240, 180 + view.height))
        cell.paste(Image.open(seen).convert("RGB").resize((240, 180)), (0, 0))
        cell.paste(view, (0, 180))
        cells.append(cell)
    shown = cells[:: max(1, len(cells) // 6)][:6]
    sheet = Image.new("RGB", (240 * len(shown), cells[0].height))
    for i, cell in enumerate(shown):
        sheet.paste(cell, (240 * i, 0))
    sheet.save(args.out / "fig8_sheet.jpg", quality=85)
    cells[0].save(args.out / "fig8.webp", save_all=True, append_images=cells[1:], duration=120, loop=0,
                  quality=50)


if __name__ == "__main__":
    arguments = common.arguments("fig8_sequence", __doc__, frames=(30, 2), half=(0, 0))
    report(arguments, run(arguments))
