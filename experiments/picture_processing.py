#!/usr/bin/python3
"""What cameras do to their pictures: each step alone, and what it costs.

One frame of the bunny before six cameras and six projectors, 1280 x 960, pitch 12, medium noise in 16 bits. Every row takes the
same light through another step that cameras or their drivers are known for; the rig states what a user would know of it.
"""

import json

import cv2
import numpy as np

import common
import heldout

SEED = 12


def gamma_of(light, gamma=2.2):
    return np.maximum(light, 0) ** (1 / gamma)


def to_8_bits(values):
    return np.clip(255 * values + 0.5, 0, 255).astype(np.uint8)


def low_bits(values, bits, black=0):
    """As a sensor of so many bits leaves its values in a file of 16."""
    full = 2**bits - 1
    return np.clip((full - black) * values + black + 0.5, 0, full).astype(np.uint16)


def jpeg(values, quality):
    return cv2.imdecode(cv2.imencode(".jpg", to_8_bits(values), [cv2.IMWRITE_JPEG_QUALITY, quality])[1], -1)


def sharpened(values, amount=0.6, radius=1.0):
    return values + amount * (values - cv2.GaussianBlur(values, (0, 0), radius))


def halved_colors(values):
    """YCrCb 4:2:2: two pixels beside each other share their colour."""
    parts = cv2.cvtColor(np.clip(values, 0, 1).astype(np.float32), cv2.COLOR_BGR2YCrCb)
    means = (parts[:, 0::2, 1:] + parts[:, 1::2, 1:]) / 2
    parts[..., 1:] = np.repeat(means, 2, axis=1)
    return cv2.cvtColor(parts, cv2.COLOR_YCrCb2BGR)


def mixed(light):
    """A matrix that makes colours more saturated, as cameras' pictures for the eye have it."""
    matrix = np.array([[1.5, -0.4, -0.1], [-0.3, 1.6, -0.3], [-0.05, -0.45, 1.5]], np.float32)  # of B, G, R
    return np.clip(light @ matrix.T, 0, 1)


def vignetted(light):
    v, u = np.mgrid[-1:1:light.shape[0] * 1j, -1:1:light.shape[1] * 1j]
    return light * (1 - 0.35 * (u**2 + v**2))[..., None].astype(np.float32)


def with_hot_pixels(light):
    die = np.random.default_rng(SEED).random(light.shape[:2])
    light = light.copy()
    light[die < 2e-4], light[die > 1 - 2e-4] = 1, 0
    return light


def filled_in(light):
    """OpenCV's means of the nearest samples of an RGGB mosaic (which it calls BG)."""
    samples = to_8_bits(light)
    raw = samples[..., 1].copy()
    raw[0::2, 0::2], raw[1::2, 1::2] = samples[0::2, 0::2, 2], samples[1::2, 1::2, 0]
    return cv2.demosaicing(raw, cv2.COLOR_BayerBG2BGR)


# Name: the file's pixels of linear light (BGR, 0 to 1), and what the rig states.
STEPS = {
    "8 bits, linear": (to_8_bits, {}),
    "10 bits in the low ones of 16": (lambda x: low_bits(x, 10), {}),
    "12 bits in the low ones of 16, with a black level": (lambda x: low_bits(x, 12, 256), {"black_level": 256 / 65535}),
    "an eighth of the exposure": (lambda x: to_8_bits(x / 8), {}),
    "twice the exposure, overexposed": (lambda x: to_8_bits(2 * x), {}),
    "gamma 2.2, stated": (lambda x: to_8_bits(gamma_of(x)), {"gamma": 2.2}),
    "gamma 2.2, stated as 2.0": (lambda x: to_8_bits(gamma_of(x)), {"gamma": 2.0}),
    "colours filled in behind a mosaic": (filled_in, {}),
    "colours halved (4:2:2)": (lambda x: to_8_bits(halved_colors(x)), {}),
    "colours mixed for the eye": (lambda x: to_8_bits(mixed(x)), {}),
    "sharpened": (lambda x: to_8_bits(sharpened(x)), {}),
    "median of 3 x 3": (lambda x: cv2.medianBlur(to_8_bits(x), 3), {}),
    "denoised (non-local means)": (lambda x: cv2.fastNlMeansDenoisingColored(to_8_bits(x), None, 8, 8, 5, 15), {}),
    "hot and dead pixels": (lambda x: to_8_bits(with_hot_pixels(x)), {}),
    "vignetting, to .3 in the corners": (lambda x: to_8_bits(vignetted(x)), {}),
    "blurred by 1 px": (lambda x: to_8_bits(cv2.GaussianBlur(x, (0, 0), 1.0)), {}),
    "blurred by 2 px": (lambda x: to_8_bits(cv2.GaussianBlur(x, (0, 0), 2.0)), {}),
    "JPEG 92, gamma 2.2, stated": (lambda x: jpeg(gamma_of(x), 92), {"gamma": 2.2}),
    "JPEG 80, gamma 2.2, stated": (lambda x: jpeg(gamma_of(x), 80), {"gamma": 2.2}),
    "mixed, gamma 2.2, sharpened, JPEG 90": (lambda x: jpeg(sharpened(gamma_of(mixed(x))), 90), {"gamma": 2.2}),
}
SMALL = ["8 bits, linear", "10 bits in the low ones of 16"]
COLUMNS = ["label_error", "line_recall", "distance_median_mm", "mesh_distance_median_mm", "completeness_1mm",
           "sigma_below_1"]


def rendered(program, folder, is_small):
    small = ["--camera-width", 640, "--camera-height", 480, "--camera-focal-px", 1150]
    program("rig", "ring", "--overwrite", "--out", folder / "ring.json", "--pitch-px", 12, "--offset-px", 6,
            *(small if is_small else []))
    common.write_ply(folder / "bunny.ply", *heldout.MAKERS["bunny"](SEED))
    program("simulate", "--overwrite", "--rig", folder / "ring.json", "--mesh", folder / "bunny.ply", "--fit", "--out",
            folder / "scene", "--noise", "medium", "--bits", 16, "--seed", SEED)


def taken(scene, folder, step, stated):
    """The frame and the rig of a camera that does this."""
    pictures = folder / "frames/000000"
    pictures.mkdir(parents=True, exist_ok=True)
    for path in sorted((scene / "frames/000000").glob("*.png")):
        light = cv2.imread(str(path), -1).astype(np.float32) / 65535
        cv2.imwrite(str(pictures / path.name), step(light))
    rig = json.loads((scene / "rig.json").read_text())
    for camera in rig["cameras"]:
        camera.update(stated)
    return common.write_rig(folder / "rig.json", rig)


def main():
    args = common.arguments("picture_processing", __doc__)
    args.reconstruct, args.keep = "", True  # of heldout.measure()
    program = common.Program(args)
    rows = common.Rows(args.out / "results.csv", ["step"], [*COLUMNS, "said"], args.resume)
    rendered(program, args.out, args.small)
    for number, (name, (step, stated)) in enumerate(STEPS.items()):
        if rows.has(step=name) or (args.small and name not in SMALL):
            continue
        common.progress(f"picture_processing: {name}")
        folder = args.out / "work" / str(number)
        rig = taken(args.out / "scene", folder, step, stated)
        figures = heldout.measure(args, program, args.out / "scene", rig, folder / "frames", folder / "made")
        if not figures:
            raise SystemExit(f"picture_processing: no result of '{name}': see {args.out / 'commands.log'}")
        report = json.loads((folder / "made/result/000000/report.json").read_text())
        said = sorted({finding["code"] for finding in report["findings"]})
        rows.add(step=name, said=" ".join(said), **{key: figures[key] for key in COLUMNS})
    table = [[row["step"], f"{100 * row['label_error']:.3f}", *(f"{row[key]:.3f}" for key in COLUMNS[1:2]),
              *(f"{row[key]:.4f}" for key in COLUMNS[2:4]), *(f"{row[key]:.3f}" for key in COLUMNS[4:5]),
              f"{row['sigma_below_1']:.2f}", row["said"] or "-"] for row in rows.rows]
    common.print_table(args.out / "table.md", "What cameras do to their pictures",
                       ["pictures", "label error, %", "line recall", "points, median mm", "mesh, median mm",
                        "complete at 1 mm", "below one sigma", "findings"], table)


main()
