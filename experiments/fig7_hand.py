#!/usr/bin/python3
"""Fig. 7 of the paper: thin fingers, the grid of one projector against lines of two projectors.

A camera sees an open hand. The one-projector method (Sagawa et al. 2009) has a grid, the paper's and
ours have vertical and horizontal lines from two projectors. The share of a finger that is recovered:
of the millimetres along its axis those that hold a point within 1 mm of its true surface; its lowest
quarter, which the palm surrounds, does not count.
"""

import shutil

import numpy as np

import common
import shapes

CAMERAS = [(-4, 12), (14, 20)]  # azimuth, elevation; multiview and joint have both
DISTANCE = 1100
# Name of a series: method, pitches of vertical and horizontal lines in projector px, cameras.
SERIES = {
    "one projector, 12 and 24 px": ("single-projector", 12, 24, 1),
    "one projector, 12 and 12 px": ("single-projector", 12, 12, 1),
    "two projectors, linear, 8 px": ("linear", 8, 8, 1),
    "two projectors, multiview, 8 px": ("multiview", 8, 8, 2),
    "two projectors, joint, 8 px, one camera": ("joint", 8, 8, 1),
    "two projectors, joint, 8 px": ("joint", 8, 8, 2),
    "two projectors, joint, 12 px": ("joint", 12, 12, 2),
}


def make_rig(method, vertical_pitch, horizontal_pitch, cameras):
    cameras = [common.device(f"cam{i}", (1280, 960), 2900, common.on_sphere(a, e, DISTANCE))
               for i, (a, e) in enumerate(CAMERAS[:cameras])]
    vertical = common.pattern("vertical", vertical_pitch)
    horizontal = common.pattern("horizontal", horizontal_pitch, vertical_pitch / 3)
    panel, focal = (1280, 1024), 3000
    if method == "single-projector":  # raised sideways, so that lines of both directions give depth
        one = common.device("proj0", panel, focal, common.on_sphere(16, 32, DISTANCE))
        one["pattern"] = [vertical, horizontal]
        return common.rig_of(cameras, [one], 140)
    first = common.device("proj0", panel, focal, common.on_sphere(-20, 9, DISTANCE))
    second = common.device("proj1", panel, focal, common.on_sphere(17, 34, DISTANCE))
    first["pattern"], second["pattern"] = vertical, horizontal
    return common.rig_of(cameras, [first, second], 140)


def distance_to_finger(points, finger):
    """Signed distance from the finger's tapered rod, mm."""
    start, end, radius = finger
    axis = (end - start) / np.linalg.norm(end - start)
    along = np.clip((points - start) @ axis, 0, np.linalg.norm(end - start))
    taper = 1 - 0.15 * along / np.linalg.norm(end - start)
    return np.linalg.norm(points - start - along[:, None] * axis, axis=1) - radius * taper


def finger_shares(points, fingers):
    """Share of the millimetres of each finger that hold a right point."""
    positions = common.positions(points)
    shares = {}
    for name, finger in fingers.items():
        start, end, radius = finger
        length = np.linalg.norm(end - start)
        along = (positions - start) @ (end - start) / length
        right = np.abs(distance_to_finger(positions, finger)) < 1
        first = 0.25 * length
        cells = int((length - first) / 1)
        if cells < 1:
            continue
        hit = np.floor(along[right & (along >= first)] - first).astype(int)
        shares[name] = len(np.unique(hit[(hit >= 0) & (hit < cells)])) / cells
    return shares


def run(args):
    program = common.Program(args)
    names = [f[0] for f in shapes.FINGERS]
    rows = common.Rows(args.out / "results.csv", ["thickness_mm", "series", "draw"],
                       [*names, "worst", "mean", "points", "label_error"], args.resume)
    for thickness in args.thicknesses:
        vertices, triangles, fingers = shapes.hand(thickness)
        mesh = args.out / "work/hand.ply"
        common.write_ply(mesh, vertices, triangles)
        for series, (method, *numbers) in SERIES.items():
            if args.small and series not in (list(SERIES)[0], list(SERIES)[5]):
                continue
            for draw in range(1, args.draws + 1):
                if rows.has(thickness_mm=thickness, series=series, draw=draw):
                    continue
                rig = common.write_rig(args.out / "work/rig.json", make_rig(method, *numbers))
                scene, out = args.out / "work/scene", args.out / "work/result"
                program("simulate", "--rig", rig, "--mesh", mesh, "--noise", "medium", "--out", scene,
                        "--overwrite", "--seed", draw, "--samples", 2 if args.small else 3)
                shown = thickness == args.shown and draw == 1
                done = program("reconstruct", "--rig", rig, "--frames", scene / "frames", "--out", out,
                               "--overwrite", "--method", method, "--no-mesh",
                               *([] if shown else ["--no-pictures"]), may_fail=True)
                row = {"thickness_mm": thickness, "series": series, "draw": draw}
                if not done:
                    rows.add(**row, **{n: 0 for n in names}, worst=0, mean=0, points=0)
                    continue
                points, _ = common.read_ply(out / "000000/points.ply")
                shares = finger_shares(points, fingers)
                figures = program("evaluate", "--truth", scene / "truth/mesh.ply", "--rig", rig,
                                  "--result", out / "000000/points.ply")
                rows.add(**row, **shares, worst=min(shares.values()),
                         mean=float(np.mean(list(shares.values()))), points=len(points),
                         label_error=figures["label_error"])
                if shown:
                    keep = shown_folder(args, series)
                    shutil.rmtree(keep, ignore_errors=True)
                    shutil.copytree(out / "000000", keep)
                    shutil.copy(rig, keep / "rig.json")
        common.progress(f"fig7_hand: fingers of {thickness} mm")
    return rows


def report(args, rows):
    names = [f[0] for f in shapes.FINGERS]
    shown = [s for s in SERIES if rows.select(series=s)]
    table = [[s] + [common.number(float(np.nanmedian(rows.column(n, series=s,
                                                                 thickness_mm=args.shown))), 2)
                    for n in [*names, "label_error"]] for s in shown]
    common.print_table(args.out / "table.md",
                       f"Share of each finger recovered, fingers {args.shown} mm thick",
                       ["", *names, "label error"], table)
    table = []
    for s in shown:
        means = [float(np.nanmedian(rows.column("mean", series=s, thickness_mm=t)))
                 for t in args.thicknesses]
        table.append([s] + [common.number(m, 2) for m in means])
    common.print_table(args.out / "sweep.md", "Mean share of the fingers by their thickness",
                       ["", *[f"{t} mm" for t in args.thicknesses]], table)
    plot(args, rows, shown)
    if not args.small:
        picture(args)


def shown_folder(args, series):
    return args.out / "shown" / series.replace(", ", "_").replace(" ", "_")


def picture(args):
    """The paper's Fig. 7: captured, grid graph by local ID, points (colour: height over the palm)."""
    from PIL import Image
    plt = common.plots()
    series = [s for s in list(SERIES) if s.startswith("one") or "joint, 8 px" in s]
    figure, axes = plt.subplots(3, len(series), figsize=(2.6 * len(series), 8))
    for column, name in enumerate(series):
        folder = shown_folder(args, name)
        for axis, file in zip(axes[:2, column], ["cam0.jpg", "cam0_local_id.png"]):
            axis.imshow(Image.open(folder / "pictures" / file).convert("RGB").crop((470, 180, 930, 790)))
            axis.set_axis_off()
        axes[0, column].set_title(name.replace(", ", "\n", 1))
        points, _ = common.read_ply(folder / "points.ply")
        points = points[points["camera"] == 0]
        axes[2, column].scatter(points["y"], points["z"], s=0.2, c=points["x"], vmin=-20, vmax=30,
                                cmap="viridis")
        axes[2, column].set(aspect="equal", xlim=(-75, 100), ylim=(-115, 115))
        axes[2, column].set_axis_off()
    figure.tight_layout()
    figure.savefig(args.out / "fig7_hand.jpg", pil_kwargs={"quality": 85})


def plot(args, rows, shown):
    plt = common.plots()
    figure, axis = plt.subplots(figsize=(5.5, 3))
    for series in shown:
        method, pitch, across, cameras = SERIES[series]
        middle = [np.nanmedian(rows.column("mean", series=series, thickness_mm=t))
                  for t in args.thicknesses]
        axis.plot(args.thicknesses, middle, color=common.METHOD_COLORS[method], label=series,
                  marker="o", ms=3, ls="-" if pitch == 8 or across == 24 else "--",
                  alpha=0.5 if cameras == 1 and method == "joint" else 1)
    axis.set_xscale("log")
    axis.set_xticks(args.thicknesses, [f"{t:g}" for t in args.thicknesses])
    axis.minorticks_off()
    axis.set_xlabel("finger thickness, mm")
    axis.set_ylabel("share of the fingers recovered")
    axis.set_ylim(0, 1.02)
    axis.legend(fontsize=6)
    figure.savefig(args.out / "fig7_sweep.png")


if __name__ == "__main__":
    arguments = common.arguments("fig7_hand", __doc__, draws=(3, 1))
    arguments.thicknesses = [16] if arguments.small else [3, 4, 6, 8, 12, 16, 20]
    arguments.shown = 16 if arguments.small else 8
    report(arguments, run(arguments))
