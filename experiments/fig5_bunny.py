#!/usr/bin/python3
"""Fig. 5 of the paper: the Stanford bunny between six cameras and six projectors, three methods.

With --povray the pictures are rendered by POV-Ray as in the paper, without sensor noise; else by the
simulator with medium noise.
"""

import shutil
import subprocess

import common

METHODS = ["linear", "multiview", "joint"]
FIGURES = {"label_error": ("label error", 4), "line_recall": ("line recall", 3),
           "line_recall_3_5px": ("line recall, 3-5 px", 3),
           "distance_median_mm": ("distance, median, mm", 3),
           "distance_p90_mm": ("distance, 90 %, mm", 3), "completeness_1mm": ("completeness 1 mm", 3),
           "f_score_1mm": ("F-score 1 mm", 3)}


def render(args, program):
    scene = args.out / "scene"
    rig = args.out / "rig.json"
    program("rig", "ring", "--overwrite", "--out", rig, *(common.SMALL_RING if args.small else []))
    program("simulate", "--rig", rig, "--mesh", common.BUNNY, "--fit", "--up", "y", "--out", scene,
            "--overwrite", "--seed", 1, *(["--export-povray"] if args.povray else ["--noise", "medium"]),
            "--samples", 2 if args.small else 3)
    if args.povray:
        for ini in sorted((scene / "povray/000000").glob("*.ini")):
            subprocess.run(["povray", ini.name, "-D"], cwd=ini.parent, check=True, capture_output=True)
            shutil.copy(ini.with_suffix(".png"), scene / "frames/000000" / f"{ini.stem}.png")
    return scene


def run(args):
    program = common.Program(args)
    scene = render(args, program)
    rows = common.Rows(args.out / "results.csv", ["method"], list(FIGURES))
    for method in METHODS:
        out = args.out / method
        program("reconstruct", "--rig", scene / "rig.json", "--frames", scene / "frames", "--out", out,
                "--method", method, "--overwrite")
        figures = program("evaluate", "--truth", scene / "truth/mesh.ply", "--rig",
                          scene / "rig.json", "--result", out / "000000")
        rows.add(method=method, **{k: figures.get(k) for k in FIGURES})
        common.progress(f"fig5_bunny: {method}")
    common.print_table(args.out / "table.md", "The bunny, one frame", ["", *METHODS],
                       [[name] + [common.number(rows.column(k, method=m)[0], digits) for m in METHODS]
                        for k, (name, digits) in FIGURES.items()])
    picture(args, scene)


def picture(args, scene):
    """Captured image, curves with IDs, shape among the devices; then the shaded shape by method."""
    from PIL import Image
    first = args.out / "joint/000000/pictures"
    top = [first / "cam0.jpg", first / "cam0_local_id.png", first / "scene.png"]
    plt = common.plots()
    figure, axes = plt.subplots(2, 3, figsize=(12, 7), dpi=130)
    titles = ["captured", "curves by local ID", "shape among the devices", *METHODS]
    files = top + [args.out / m / "000000/pictures/shape.png" for m in METHODS]
    for axis, title, file in zip(axes.flat, titles, files):
        axis.imshow(Image.open(file).convert("RGB"))
        axis.set_title(title)
        axis.set_axis_off()
    figure.tight_layout(pad=0.2)
    figure.savefig(args.out / "fig5_bunny.jpg", pil_kwargs={"quality": 85})


if __name__ == "__main__":
    import sys
    povray = "--povray" in sys.argv
    if povray:
        sys.argv.remove("--povray")
    arguments = common.arguments("fig5_bunny", __doc__)
    arguments.povray = povray
    run(arguments)
