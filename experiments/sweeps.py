#!/usr/bin/python3
"""Where it breaks: one parameter of rig, scene or sensor at a time, the paper's methods beside ours.

Everything else stays at three cameras and three projectors over 150 degrees, 12 px pitch, the bunny in
a volume of 170 mm radius, medium sensor noise. One draw per value (seed 1). The paper's methods are
measured by their points; the mesh is that of joint.
"""

import numpy as np

import common
import shapes

METHODS = ["linear", "multiview", "joint"]
FIGURES = ["label_error", "line_recall", "distance_median_mm", "completeness_1mm", "points"]
BASE = {"cameras": 3, "projectors": 3, "arc": 150, "pitch": 12, "radius": 160, "calibration": 0}

# name: label of the axis, values, and what a value changes: the base above, or options of simulate
SWEEPS = {
    "pitch": ("line pitch, projector px", [5, 6, 8, 10, 12, 16, 24], lambda v: ({"pitch": v}, [])),
    "noise": ("sensor noise, times medium", [0.5, 1, 2, 4, 8],
              lambda v: ({}, ["--full-well", 6000 / v**2, "--read-noise", 1.5 * v])),
    "blur": ("camera blur, standard deviation, px", [0.3, 0.7, 1.2, 1.8, 2.5],
             lambda v: ({}, ["--blur", v])),
    "crosstalk": ("crosstalk, share of a channel", [0, 0.08, 0.16, 0.24, 0.32],
                  lambda v: ({}, ["--crosstalk", v])),
    "ambient": ("ambient light, image value", [0, 0.05, 0.1, 0.2, 0.4],
                lambda v: ({}, ["--ambient", v])),
    "texture": ("texture contrast (20 mm noise)", [0, 0.3, 0.6, 0.8, 0.95],
                lambda v: ({}, ["--texture", "noise", "--contrast", v])),
    "calibration": ("calibration error of every device, px", [0, 0.25, 0.5, 1, 2, 3],
                    lambda v: ({"calibration": v}, [])),
    "devices": ("cameras and projectors on the full circle", [2, 3, 4, 6, 8],
                lambda v: ({"cameras": v, "projectors": v, "arc": 360}, [])),
    "size": ("radius of the object, mm", [10, 20, 40, 80, 160], lambda v: ({"radius": v}, [])),
}


def bunny(radius):
    """The bunny upright, its farthest vertex `radius` mm from the middle of its box."""
    vertices, triangles = shapes.bunny()
    vertices -= (vertices.min(0) + vertices.max(0)) / 2
    return vertices * radius / np.linalg.norm(vertices, axis=1).max(), triangles


def measure(args, program, rows, name, value):
    todo = [m for m in METHODS if not rows.has(sweep=name, value=value, method=m)]
    if not todo:
        return
    change, options = SWEEPS[name][2](value)
    base = {**BASE, **change}
    rig_path, scene, out = args.out / "work/rig.json", args.out / "work/scene", args.out / "work/out"
    if args.small:
        program("rig", "ring", "--overwrite", "--out", rig_path, *common.SMALL_RING)
    else:
        program("rig", "ring", "--overwrite", "--out", rig_path, "--cameras", base["cameras"], "--projectors",
                base["projectors"], "--arc-deg", base["arc"], "--pitch-px", base["pitch"],
                "--line-width-px", base["pitch"] / 3, "--offset-px", base["pitch"] / 2)
    mesh = args.out / "work/bunny.ply"
    common.write_ply(mesh, *bunny(base["radius"]))
    program("simulate", "--rig", rig_path, "--mesh", mesh, "--noise", "medium", "--out", scene,
            "--overwrite", "--seed", 1, "--samples", 2, *options)
    true_rig = common.json.loads(rig_path.read_text())
    used = common.write_rig(args.out / "work/used.json",
                            common.with_calibration_error(true_rig, base["calibration"], seed=1))
    for method in todo:
        done = program("reconstruct", "--rig", used, "--frames", scene / "frames", "--out", out,
                       "--overwrite", "--method", method, "--no-pictures",
                       *([] if method == "joint" else ["--no-mesh"]), may_fail=True)
        # Labels are judged with the true rig. Distances of a wrong rig count after a rigid motion.
        result = out / "000000" if method == "joint" else out / "000000/points.ply"
        figures = {"label_error": None, "line_recall": 0, "points": 0, "completeness_1mm": 0}
        if done:
            align = ["--align", "rigid"] if base["calibration"] else []
            figures = program("evaluate", "--truth", scene / "truth/mesh.ply", "--rig", scene /
                              "rig.json", "--result", result, *align)
        if method != "joint":
            figures["completeness_1mm"] = None
        rows.add(sweep=name, value=value, method=method, **{k: figures.get(k) for k in FIGURES})
    common.progress(f"sweeps: {name} {value}")


def plot(args, rows, names):
    plt = common.plots()
    shown = [("label_error", "label error"), ("line_recall", "line recall"),
             ("distance_median_mm", "distance, median, mm"),
             ("completeness_1mm", "mesh within 1 mm (joint)")]
    for name in names:
        figure, axes = plt.subplots(1, 4, figsize=(11, 2.3))
        for axis, (key, label) in zip(axes, shown):
            for method in METHODS:
                points = sorted((r["value"], r[key]) for r in rows.select(sweep=name, method=method)
                                if r[key] != "")
                if points:
                    axis.plot(*zip(*points), marker="o", ms=3, label=method,
                              color=common.METHOD_COLORS[method])
            axis.set_ylabel(label)
            axis.set_xlabel(SWEEPS[name][0])
            if key == "distance_median_mm":
                axis.set_yscale("log")
            else:
                axis.set_ylim(-0.02, 1.02)
        axes[0].legend(fontsize=6)
        figure.tight_layout()
        figure.savefig(args.out / f"sweep_{name}.svg", metadata={"Date": None})
        plt.close(figure)


if __name__ == "__main__":
    arguments = common.arguments("sweeps", __doc__, only=("", "size"))
    chosen = [n for n in SWEEPS if not arguments.only or n in arguments.only.split(",")]
    results = common.Rows(arguments.out / "results.csv", ["sweep", "value", "method"], FIGURES,
                          arguments.resume)
    for sweep in chosen:
        for v in SWEEPS[sweep][1][-1:] if arguments.small else SWEEPS[sweep][1]:
            measure(arguments, common.Program(arguments), results, sweep, v)
        plot(arguments, results, [sweep])
    common.print_table(arguments.out / "table.md", "All sweeps", results.columns,
                       [[row[c] for c in results.columns] for row in results.rows])
