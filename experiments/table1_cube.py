#!/usr/bin/python3
"""Table I of the paper: two faces of a cube before two cameras and two projectors (its Fig. 6).

Per draw the sensor noise, the calibration error's direction and the line noise are new; draws of one
number share them over all methods. With --share k what takes long (surface, refined rig, scan,
calibrated rig, line noise) is done for the first of k draws only. Faces are told apart by the true cube
behind each pixel, 8 mm off its edges, and fitted by least squares without leaving anything out, as in
the paper.
"""

import math
import shutil

import numpy as np

import common
import shapes

EDGE = 190  # mm
TURN = 46  # degrees: an edge towards the cameras
METHODS = ["linear", "multiview", "joint", "surface", "refined joint", "refined surface", "scan"]
PAPER = {"linear": ("97.7", "0.00094"), "multiview": ("90.1", "0.00181")}


def fig6_rig():
    size, panel = (1280, 960), (1280, 1024)
    cameras = [common.device("cam0", size, 2300, common.on_sphere(-4, 18, 1150)),
               common.device("cam1", size, 2300, common.on_sphere(10, 15, 1100))]
    vertical = common.device("proj0", panel, 2430, common.on_sphere(-20, 9, 1130))
    horizontal = common.device("proj1", panel, 2430, common.on_sphere(17, 34, 1110))
    vertical["pattern"] = common.pattern("vertical", 12)
    horizontal["pattern"] = common.pattern("horizontal", 12)
    return common.rig_of(cameras, [vertical, horizontal], 170)


def face_of_pixels(camera, pixels, margin=8):
    """0 or 1: the cube's two faces towards the cameras; -1: anything else, or near an edge."""
    a = math.radians(TURN)
    cube_from_world = np.array([[math.cos(a), math.sin(a), 0], [-math.sin(a), math.cos(a), 0],
                                [0, 0, 1]])
    origin = cube_from_world @ common.center_of(camera)
    directions = common.rays(camera, pixels) @ cube_from_world.T
    with np.errstate(divide="ignore", invalid="ignore"):
        entry = (-np.sign(directions) * EDGE / 2 - origin) / directions
    axis = np.argmax(entry, 1)
    at = origin + entry.max(1)[:, None] * directions
    inside = np.sum(np.abs(at) < EDGE / 2 - margin, 1) == 2
    towards = -np.sign(directions[np.arange(len(axis)), axis])
    face = np.full(len(axis), -1)
    face[inside & (axis == 0) & (towards > 0)] = 0
    face[inside & (axis == 1) & (towards < 0)] = 1
    return face


def plane_figures(points, face, eye):
    """Inner angle of the two fitted planes in degrees, RMSE over the mean distance from the camera."""
    normals, squares = [], []
    for k in (0, 1):
        on_face = points[face == k]
        if len(on_face) < 100:
            return {}
        middle = on_face.mean(0)
        _, s, axes = np.linalg.svd(on_face - middle, full_matrices=False)
        normals.append(axes[2] * np.sign(axes[2] @ (eye - middle)))
        squares.append((s[2] ** 2, len(on_face)))
    angle = 180 - math.degrees(math.acos(np.clip(normals[0] @ normals[1], -1, 1)))
    rms = math.sqrt(sum(s for s, _ in squares) / sum(n for _, n in squares))
    used = points[face >= 0]
    return {"angle_deg": angle, "rmse": rms / np.linalg.norm(used - eye, axis=1).mean(),
            "points": len(used)}


def judge_points(path, true_rig, rig):
    vertices, _ = common.read_ply(path)
    vertices = vertices[vertices["camera"] == 0]  # one camera, as in the paper
    face = face_of_pixels(true_rig["cameras"][0], np.stack([vertices["u"], vertices["v"]], 1))
    return plane_figures(common.positions(vertices), face, common.center_of(rig["cameras"][0]))


def judge_mesh(path, true_rig, rig):
    vertices, _ = common.read_ply(path)
    points = common.positions(vertices)
    pixels = common.project(rig["cameras"][0], points)
    face = face_of_pixels(true_rig["cameras"][0], pixels)
    return plane_figures(points, face, common.center_of(rig["cameras"][0]))


def add_line_noise(frame, noise_px, seed):
    """Shifts every pixel by a random field (noise_px in x and in y, correlated over 4 px): lines are
    seen that much off their place."""
    from PIL import Image
    random = np.random.default_rng(seed)
    for path in sorted(frame.glob("*.png")):
        image = np.asarray(Image.open(path), float)
        height, width = image.shape[:2]
        reach = np.arange(-12, 13)
        kernel = np.exp(-0.5 * (reach / 4.0) ** 2)
        field = random.normal(size=(2, height, width))
        for axis in (1, 2):
            field = np.apply_along_axis(np.convolve, axis, field, kernel, "same")
        field *= noise_px / field.std()
        x = np.clip(np.arange(width) + field[0], 0, width - 1.001)
        y = np.clip(np.arange(height)[:, None] + field[1], 0, height - 1.001)
        i, j = y.astype(int), x.astype(int)
        fx, fy = (x - j)[..., None], (y - i)[..., None]
        warped = ((image[i, j] * (1 - fx) + image[i, j + 1] * fx) * (1 - fy)
                  + (image[i + 1, j] * (1 - fx) + image[i + 1, j + 1] * fx) * fy)
        Image.fromarray(np.round(warped).astype(np.uint8)).save(path)


def measure(args, program, rows, true_rig, scene, setting, draw, rig, methods):
    """All methods on one draw with one (wrong) rig."""
    key = {"setting": setting, "draw": draw}
    todo = [m for m in methods if not rows.has(method=m, **key)]
    rig_path = common.write_rig(args.out / "work" / "rig.json", rig)
    out = args.out / "work" / "result"

    def reconstruct(method, *options):
        return program("reconstruct", "--rig", rig_path, "--frames", scene / "frames", "--out", out,
                       "--overwrite", "--no-pictures", "--method", method, *options, may_fail=True)

    def add(method, figures):
        rows.add(method=method, **key, **figures)

    for method in ("linear", "multiview"):
        if method in todo:
            done = reconstruct(method, "--no-mesh")
            add(method, judge_points(out / "000000/points.ply", true_rig, rig) if done else {})
    for name, options in (("", []), ("refined ", ["--refine-rig"])):
        if name + "joint" not in todo:
            continue
        with_mesh = name + "surface" in methods
        done = reconstruct("joint", *options, *([] if with_mesh else ["--no-mesh"]))
        used = rig
        if done and options:
            used = common.json.loads((out / "rig.json").read_text())
        add(name + "joint",
            judge_points(out / "000000/points.ply", true_rig, used) if done else {})
        if with_mesh:
            add(name + "surface",
                judge_mesh(out / "000000/mesh_measured.ply", true_rig, used) if done else {})
    if "scan" in todo:
        done = program("scan", "--captures", args.out / "captures/captures", "--rig", rig_path,
                       "--out", out, "--overwrite", "--no-mesh", "--step", 2, may_fail=True)
        add("scan", judge_points(out / "points.ply", true_rig, rig) if done else {})
    shutil.rmtree(out, ignore_errors=True)


def calibrated_rig(args, program, true_rig):
    """What `calibrate` makes of the cube's own Gray-code captures, intrinsics given; None: unusable."""
    devices = common.json.loads(common.json.dumps(true_rig))
    for d in devices["cameras"] + devices["projectors"]:
        del d["R"], d["t"]
    path = common.write_rig(args.out / "work" / "devices.json", devices)
    out = args.out / "work" / "calibrated" / "rig.json"
    done = program("calibrate", "--captures", args.out / "captures/captures", "--devices", path,
                   "--out", out, "--overwrite", may_fail=True)
    return common.json.loads(out.read_text()) if done else None


def run(args):
    program = common.Program(args)
    true_rig = fig6_rig()
    rig_path = common.write_rig(args.out / "rig.json", true_rig)
    mesh = args.out / "cube.ply"
    common.write_ply(mesh, *shapes.cube(EDGE, TURN))
    rows = common.Rows(args.out / "results.csv", ["setting", "method", "draw"],
                       ["angle_deg", "rmse", "points"], args.resume)
    simulate = ["simulate", "--rig", rig_path, "--mesh", mesh, "--flat", "--noise", "medium",
                "--overwrite"]
    if not args.small and not (args.out / "captures/captures").exists():
        program(*simulate, "--gray-code", "--out", args.out / "captures", "--seed", 1)
    calibrated = None if args.small else calibrated_rig(args, program, true_rig)
    few = max(1, args.draws // args.share)  # of what takes long
    for draw in range(1, args.draws + 1):
        scene = args.out / "work" / "scene"
        program(*simulate, "--out", scene, "--seed", draw)
        for px in args.errors:
            methods = METHODS if draw <= few and not args.small else METHODS[:3]
            rig = common.with_calibration_error(true_rig, px, seed=draw)
            measure(args, program, rows, true_rig, scene, f"calibration {px} px", draw, rig, methods)
        if calibrated and draw <= few:
            measure(args, program, rows, true_rig, scene, "calibrated", draw, calibrated, METHODS[:4])
        for noise_px in args.line_noise if draw <= few else []:
            program(*simulate, "--out", scene, "--seed", draw)
            add_line_noise(scene / "frames/000000", noise_px, seed=draw)
            for px in args.noise_errors:
                rig = common.with_calibration_error(true_rig, px, seed=draw)
                measure(args, program, rows, true_rig, scene,
                        f"calibration {px} px, lines {noise_px} px", draw, rig, METHODS[:3])
        common.progress(f"table1_cube: draw {draw} of {args.draws}")
    return rows


def report(args, rows):
    settings = list(dict.fromkeys(row["setting"] for row in rows.rows))
    table = []
    for setting in settings:
        for method in METHODS:
            key = {"setting": setting, "method": method}
            angle, rmse = rows.column("angle_deg", **key), rows.column("rmse", **key)
            if len(angle) == 0:
                continue
            table.append([setting, method, common.spread(angle, 3),
                          common.number(float(np.nanmax(np.abs(angle - 90))), 2)
                          if np.isfinite(angle).any() else "-",
                          common.spread(1e5 * rmse, 1), int(np.isfinite(angle).sum())])
    for method, (angle, rmse) in PAPER.items():
        table.append(["paper, real system", method, angle, "", common.number(1e5 * float(rmse), 0), 1])
    common.print_table(args.out / "table.md",
                       "Cube: inner angle of two faces and RMSE of the fitted planes over the distance "
                       "from the camera, median (quartiles) of the draws",
                       ["setting", "method", "angle, degrees", "worst off 90", "RMSE, 1e-5", "draws"],
                       table)
    plot(args, rows)


def plot(args, rows):
    plt = common.plots()
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.2))
    shown = [m for m in METHODS if rows.select(method=m)]
    colors = {**common.METHOD_COLORS, "refined joint": "tab:cyan", "refined surface": "tab:purple"}
    handles = {}
    for at, method in enumerate(shown):
        for px in args.errors:
            key = {"setting": f"calibration {px} px", "method": method}
            x = px + (at - len(shown) / 2) * 0.11
            for axis, values in ((axes[0], np.abs(rows.column("angle_deg", **key) - 90)),
                                 (axes[1], rows.column("rmse", **key))):
                values = values[np.isfinite(values)]
                if len(values) == 0:
                    continue
                axis.plot(np.full(len(values), x), values, ".", ms=3, alpha=0.4,
                          color=colors[method])
                handles[method], = axis.plot(x, np.median(values), "_", ms=9, mew=2,
                                             color=colors[method])
    axes[0].set_ylabel("|angle - 90|, degrees")
    axes[1].set_ylabel("RMSE / distance")
    for axis, paper in zip(axes, ((7.7, 0.1), (0.00094, 0.00181))):
        axis.set_yscale("log")
        axis.set_xlabel("calibration error of every device, px")
        for value, name in zip(paper, ("A", "B")):
            axis.axhline(value, color=colors["linear" if name == "A" else "multiview"], lw=0.8, ls=":")
            axis.annotate(f"paper, {name}", (axis.get_xlim()[1], value), fontsize=6, ha="right",
                          va="bottom")
    figure.legend(handles.values(), handles.keys(), fontsize=7, ncol=7, loc="upper center")
    figure.savefig(args.out / "table1_cube.png")


if __name__ == "__main__":
    arguments = common.arguments("table1_cube", __doc__, draws=(20, 1), share=(1, 1))
    arguments.errors = [0, 2] if arguments.small else [0, 1, 2, 3]
    arguments.line_noise = [] if arguments.small else [0.4, 0.8]
    arguments.noise_errors = [0, 2]
    report(arguments, run(arguments))
