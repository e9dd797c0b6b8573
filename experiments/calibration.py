#!/usr/bin/python3
"""Calibration of a ring of six cameras and six projectors from image sizes and one distance.

Gray-code captures of heaps of balls that fill the volume are rendered with lenses that distort, shifted projector
lenses and principal points off the centre. Errors are compared with the deviations that calibrate reports: inner
parameters as they are, poses in the gauge of least variance, in which they are reported.
"""

import json
import math
import os
import re
import shutil
import subprocess
import time

import numpy as np
from PIL import Image

import common
import shapes

RADIUS = 165
INNER = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"]


def lensed_ring(program, path):
    """The ring of `rig ring` with lenses as they are."""
    program("rig", "ring", "--overwrite", "--out", path, json_output=False)
    rig = json.loads(path.read_text())
    random = np.random.default_rng(7)
    for group, is_camera in (("cameras", True), ("projectors", False)):
        for d in rig[group]:
            f = d["K"][0][0] * random.uniform(0.97, 1.03)
            d["K"][0][0] = f
            d["K"][1][1] = f * random.normal(1, 0.0005)
            d["K"][0][2] += random.normal(0, 8)
            d["K"][1][2] += random.normal(0, 8) if is_camera else random.normal(190, 20)
            d["distortion"] = [random.normal(-0.1 if is_camera else -0.03, 0.03), 0.05, 0, 0, 0]
    # Turned back so that the shifted lens still looks at the middle.
    for d in rig["projectors"]:
        R, c = np.asarray(d["R"]), common.center_of(d)
        ray = np.linalg.inv(d["K"]) @ [(d["width"] - 1) / 2, (d["height"] - 1) / 2, 1]
        ray /= np.linalg.norm(ray)
        axis = np.cross(ray, [0, 0, 1.0])
        angle = math.acos(ray[2])
        turn = common._rotation(-angle * axis / np.linalg.norm(axis))
        R = turn @ R
        d["R"], d["t"] = R.tolist(), (-R @ c).tolist()
    common.write_rig(path, rig)
    return rig


def heap(seed):
    """Overlapping balls all over the volume."""
    random = np.random.default_rng(seed)
    parts = []
    while len(parts) < 26:
        x = random.uniform(-1, 1, 3)
        if np.linalg.norm(x) > 1:
            continue
        r = random.uniform(22, 45)
        c = x * (RADIUS - r)
        parts.append(shapes.capsule(c, c + [0.01, 0, 0], r, around=48, along=1, cap=24))
    return shapes.joined(parts)


def sizes_only(rig):
    return {"format": "rig/1", "unit": "unknown",
            **{g: [{k: d[k] for k in ("name", "width", "height")} for d in rig[g]]
               for g in ("cameras", "projectors")}}


def rotation_vector(R):
    w = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    s = np.linalg.norm(w)
    return w if s < 1e-12 else w / s * math.atan2(s, (np.trace(R) - 1) / 2)


def pose_changes(a, b, distance):
    """Small changes of all poses, device by device: rotation in its frame, shift over `distance`."""
    return np.concatenate([np.r_[rotation_vector(Rb @ Ra.T), (tb - ta) / distance]
                           for (Ra, ta), (Rb, tb) in zip(a, b)])


def moved(poses, scale, R, t):
    """Poses after x_new = scale R x + t."""
    result = []
    for Rd, td in poses:
        c = scale * R @ (-Rd.T @ td) + t
        result.append((Rd @ R.T, -(Rd @ R.T) @ c))
    return result


def in_least_gauge(truth, found, distance):
    """Changes of poses with the similarities taken out."""
    a = np.array([-R.T @ t for R, t in found])
    b = np.array([-R.T @ t for R, t in truth])
    u, s, v = np.linalg.svd((b - b.mean(0)).T @ (a - a.mean(0)))
    R = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    scale = s.sum() / ((a - a.mean(0))**2).sum()
    found = moved(found, scale, R, b.mean(0) - scale * R @ a.mean(0))
    h = 1e-6
    steps = [moved(truth, 1, common._rotation(h * e), np.zeros(3)) for e in np.eye(3)]
    steps += [moved(truth, 1, np.eye(3), h * distance * e) for e in np.eye(3)]
    steps += [moved(truth, 1 + h, np.eye(3), np.zeros(3))]
    G = np.stack([pose_changes(truth, s, distance) for s in steps], 1)
    Q = np.linalg.qr(G)[0]
    x = pose_changes(truth, found, distance)
    return x - Q @ (Q.T @ x)


def compare(truth, report):
    """Errors over reported deviations."""
    z, focal, held = {}, 0, 0
    devices = truth["cameras"] + truth["projectors"]
    for d, r in zip(devices, report["devices"]):
        K = d["K"]
        true = dict(zip(INNER, [K[0][0], K[1][1], K[0][2], K[1][2], *d["distortion"][:4]]))
        focal = max(focal, abs(r["parameters"]["fx"]["value"] / K[0][0] - 1))
        for name in INNER:
            p = r["parameters"][name]
            if p["sigma"] == 0:
                continue
            held += "held_at_prior" in p
            z.setdefault(name, []).append((p["value"] - true[name]) / p["sigma"])
    pose = [(np.asarray(d["R"]), np.asarray(d["t"])) for d in devices]
    found = [(np.asarray(r["R"]), np.asarray(r["t"])) for r in report["devices"]]
    distance = max(np.linalg.norm(t) for _, t in pose)
    x = in_least_gauge(pose, found, distance).reshape(-1, 6)
    for change, r in zip(x, report["devices"]):
        z.setdefault("rotation", []).extend(change[:3] / np.radians(r["rotation_sigma_axes_deg"]))
        z.setdefault("position", []).extend(change[3:] * distance / r["position_sigma"])
    everything = np.abs(np.concatenate(list(z.values())))
    worst = {k: float(np.abs(v).max()) for k, v in z.items()}
    return {"focal_error_percent": 100 * focal, "worst_z": float(everything.max()),
            "share_above_3": float(np.mean(everything > 3)),
            "rms_z": float(np.sqrt(np.mean(everything**2))), "at_prior": held, "worst": worst}


def calibrate(args, program, truth, folders, out, *more):
    """Runs calibrate; its figures, accuracy against the truth, z of all errors."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    known = np.linalg.norm(common.center_of(truth["cameras"][0]) - common.center_of(truth["cameras"][1]))
    words = [str(args.program.resolve()), "calibrate", "--out", str(out / "rig.json"),
             "--known-distance", "cam0", "cam1", f"{known:.6f}", "--threads", str(args.threads)]
    for folder in folders:
        words += ["--captures", str(folder)]
    words += [str(w) for w in more]
    start = time.time()
    run = subprocess.run(["/usr/bin/time", "-v", *words] if shutil.which("/usr/bin/time") else words,
                         capture_output=True, text=True)
    seconds = time.time() - start
    if run.returncode == 2:
        raise SystemExit(run.stderr)
    report = json.loads((out / "calibration.json").read_text())
    row = {"verdict": report["verdict"], "rms_px": report["rms_px"], "seconds": seconds,
           "tracks": report["tracks"], "reasons": [r["what"] for r in report["reasons"]]}
    memory = re.search(r"Maximum resident set size \(kbytes\): (\d+)", run.stderr)
    if memory:
        row["memory_gb"] = int(memory[1]) / 1e6
    if report["verdict"] != "unusable":
        row.update(compare(truth, report))
        apart = projections_apart(args, out.parent / "truth.json", out / "rig.json")
        row.update({key: apart[key] for key in ("projection_median_px", "projection_p95_px") if key in apart})
    return row


def projections_apart(args, first, second):
    """What benchmarks/calibration_accuracy says of two rigs; nothing where it is not built."""
    accuracy = args.program.parent / "benchmarks/calibration_accuracy"
    if not accuracy.exists():
        return {}
    run = subprocess.run([accuracy, first, second], capture_output=True, text=True)
    if run.returncode != 0:
        raise SystemExit(run.stderr)
    return {key: float(px) for key, px in re.findall(r"^(projection_\w+)\s+(\S+)", run.stdout, re.MULTILINE)}


def show(name, row):
    keys = ["verdict", "tracks", "rms_px", "focal_error_percent", "projection_median_px", "projection_p95_px", "rms_z",
            "worst_z", "share_above_3", "at_prior", "seconds", "memory_gb"]
    print(name + ": " + ", ".join(f"{k} {row[k]:.4g}" if isinstance(row.get(k), float) else f"{k} {row.get(k)}"
                                  for k in keys), flush=True)
    for reason in row["reasons"]:
        print("   ", reason)
    if "worst" in row:
        print("    worst z:", {k: round(v, 2) for k, v in row["worst"].items()}, flush=True)


def render(program, args, noise, seed, rig, name):
    out = args.out / noise / name
    if not (out / "done").exists():
        shutil.rmtree(out, ignore_errors=True)
        mesh = args.out / f"heap{seed}.ply"
        common.write_ply(mesh, *heap(seed))
        program("simulate", "--rig", rig, "--mesh", mesh, "--gray-code", "--noise", noise, "--samples", 2,
                "--seed", seed, "--out", out, json_output=False)
        (out / "done").write_text("")
    return out / "captures"


# ---- poor guesses ---------------------------------------------------------------------------------


def from_guesses(args, program, truth, noise):
    """K of all devices guessed badly, four times; how far apart the rigs end."""
    folders = [render(program, args, noise, seed, args.out / "truth.json", f"capture{seed}")
               for seed in range(args.captures)]
    rows = {}
    for k, factor in enumerate((0.7, 0.85, 1.25, 1.5)):
        random = np.random.default_rng(k)
        guess = sizes_only(truth)
        for group in ("cameras", "projectors"):
            for d, t in zip(guess[group], truth[group]):
                f = t["K"][0][0] * factor * random.uniform(0.95, 1.05)
                d["K"] = [[f, 0, d["width"] / 2], [0, f, d["height"] / 2], [0, 0, 1]]
        devices = common.write_rig(args.out / f"guess{k}.json", guess)
        row = calibrate(args, program, truth, folders, args.out / f"found_guess{k}", "--devices", devices,
                        "--max-tracks", args.broken_tracks)
        first = args.out / "found_guess0" / "rig.json"
        if k > 0 and row["verdict"] != "unusable" and first.exists():
            apart = projections_apart(args, first, args.out / f"found_guess{k}" / "rig.json")
            row["from_first_max_px"] = apart.get("projection_max_px")
        rows[f"K times {factor}"] = row
        show(f"K times {factor}", row)
        if k > 0:
            print("    largest difference of a projection from the first, px:", row.get("from_first_max_px"))
    return rows


# ---- what goes wrong ------------------------------------------------------------------------------


def copied(folder, to):
    """A copy of captures whose files are links to the same bytes."""
    shutil.rmtree(to, ignore_errors=True)
    shutil.copytree(folder, to, copy_function=os.link)
    return to


def replace_image(path, image):
    path.unlink()  # not the original that it is linked to
    Image.fromarray(image).save(path)


class Draw:
    """Which devices a failure hits."""

    def __init__(self, truth, number):
        self.truth = truth
        self.random = np.random.default_rng(number)

    def device(self, group):
        return self.truth[group][self.random.integers(len(self.truth[group]))]

    def partners(self, device, group):
        """Devices of the other kind that see surfaces which `device` sees: less than 100 degrees away."""
        def direction(d):
            c = common.center_of(d) * [1, 1, 0]
            return c / np.linalg.norm(c)
        return [d for d in self.truth[group] if direction(device) @ direction(d) > math.cos(math.radians(100))]

    def two(self, devices):
        chosen = sorted(self.random.choice(len(devices), 2, replace=False))
        return [devices[i] for i in chosen]

    def pair(self):
        """Folder of a projector and a camera that have surfaces in common."""
        projector = self.device("projectors")
        cameras = self.partners(projector, "cameras")
        return f"{projector['name']}/{cameras[self.random.integers(len(cameras))]['name']}"


def moved_camera(args, program, draw, folders, out, noise):
    """A camera is shifted by 4 mm and turned by 0.3 degrees before the second half of the captures."""
    d = json.loads(json.dumps(draw.device("cameras")))
    R, c = np.asarray(d["R"]), common.center_of(d)
    shift, axis = draw.random.normal(size=(2, 3))
    R = common._rotation(math.radians(0.3) * axis / np.linalg.norm(axis)) @ R
    d["R"], d["t"] = R.tolist(), (-R @ (c + 4 * shift / np.linalg.norm(shift))).tolist()
    path = common.write_rig(out / "moved.json", {**draw.truth, "cameras": [d]})
    for k in range(len(folders) // 2, len(folders)):
        shutil.rmtree(args.out / noise / "moved", ignore_errors=True)
        scene = render(program, args, noise, args.first_capture + k, path, "moved")
        for pair in scene.glob(f"*/{d['name']}"):
            shutil.rmtree(folders[k] / pair.parent.name / d["name"])
            shutil.copytree(pair, folders[k] / pair.parent.name / d["name"])
    return [f"camera {d['name']} has moved"]


def inverted_order(args, program, draw, folders, out, noise):
    """Each inverse of one pair comes before its pattern in one capture."""
    pair = draw.pair()
    k = draw.random.integers(len(folders))
    files = sorted((folders[k] / pair).glob("*.png"))
    for pattern, inverse in zip(files[2::2], files[3::2]):
        pattern.rename(out / "swap.png")
        inverse.rename(pattern)
        (out / "swap.png").rename(inverse)
    return [f"the images of {pair} (--captures number {k + 1}) are in the wrong order"]


def missing_projector(args, program, draw, folders, out, noise):
    """One projector is in no capture of two cameras."""
    projector = draw.device("projectors")
    cameras = draw.two(draw.partners(projector, "cameras"))
    for folder in folders:
        for camera in cameras:
            shutil.rmtree(folder / projector["name"] / camera["name"], ignore_errors=True)
    return []


def outliers(args, program, draw, folders, out, noise):
    """Thirty per cent of the lit blocks of 16 x 16 pixels of every pair lie elsewhere in its images."""
    size = 16
    for folder in folders:
        for pair in sorted(folder.glob("*/*")):
            files = sorted(pair.glob("*.png"))
            white = np.asarray(Image.open(files[0]))
            lit = white.reshape(white.shape[0], white.shape[1], -1).max(2).astype(int)
            black = np.asarray(Image.open(files[1]))
            lit -= black.reshape(white.shape[0], white.shape[1], -1).max(2)
            places = [(j, i) for j in range(0, white.shape[0] - size + 1, size)
                      for i in range(0, white.shape[1] - size + 1, size)
                      if lit[j:j + size, i:i + size].mean() > 15]
            if len(places) < 4:
                continue
            chosen = draw.random.choice(len(places), int(0.3 * len(places)), replace=False)
            source = np.roll(chosen, 1)
            for file in files:
                old = np.asarray(Image.open(file))
                new = old.copy()
                for to, at in zip(chosen, source):
                    (j, i), (y, x) = places[to], places[at]
                    new[j:j + size, i:i + size] = old[y:y + size, x:x + size]
                replace_image(file, new)
    return []


def swapped_folders(args, program, draw, folders, out, noise):
    """Two folders of a projector (or of a camera) are exchanged in all captures."""
    if draw.random.integers(2) == 0:
        projector = draw.device("projectors")
        a, b = (f"{projector['name']}/{c['name']}" for c in draw.two(draw.partners(projector, "cameras")))
    else:
        camera = draw.device("cameras")
        a, b = (f"{p['name']}/{camera['name']}" for p in draw.two(draw.partners(camera, "projectors")))
    for folder in folders:
        (folder / a).rename(out / "swap")
        (folder / b).rename(folder / a)
        (out / "swap").rename(folder / b)
    return [f"{a} and {b} are swapped"]


FAILURES = [moved_camera, inverted_order, missing_projector, outliers, swapped_folders]


def break_captures(args, program, truth, noise):
    """Each failure by itself, a few draws of each, K of the cameras given; what must be named, and what was."""
    known = sizes_only(truth)
    for d, c in zip(known["cameras"], truth["cameras"]):
        d.update(K=c["K"], distortion=c["distortion"])
    devices = common.write_rig(args.out / "known_cameras.json", known)
    good = [render(program, args, noise, seed, args.out / "truth.json", f"capture{seed}")
            for seed in range(args.first_capture, args.first_capture + args.broken_captures)]
    rows = {}
    for failure in [None, *FAILURES]:
        name = failure.__name__ if failure else "nothing_wrong"
        if args.only and name not in args.only:
            continue
        for number in range(args.first_draw, args.first_draw + args.draws) if failure else [0]:
            out = args.out / "broken" / name
            folders, expected = good, []
            if failure:
                folders = [copied(f, out / f"capture{k}") for k, f in enumerate(good)]
                expected = failure(args, program, Draw(truth, number), folders, out, noise)
            row = calibrate(args, program, truth, folders, args.out / f"found_{name}", "--devices", devices,
                            "--focal-tolerance", 0, "--center-tolerance", 0, "--max-tracks", args.broken_tracks)
            row["expected"] = expected
            row["named"] = all(any(e in reason for reason in row["reasons"]) for e in expected)
            rows[f"{name} {number}"] = row
            show(f"{name} {number}", row)
            print(f"    {'named' if row['named'] else 'NOT NAMED'}: {expected}", flush=True)
            shutil.rmtree(out, ignore_errors=True)
    return rows


def main():
    args = common.arguments("calibration", __doc__, captures=(6, 2), tracks=(20000, 2000),
                            broken_captures=(4, 2), broken_tracks=(6000, 2000), draws=(3, 1),
                            first_draw=(0, 0), first_capture=(0, 0), parts=("sizes,guesses,failures", "sizes"),
                            only=("", ""))
    program = common.Program(args)
    truth = lensed_ring(program, args.out / "truth.json")
    devices = common.write_rig(args.out / "devices.json", sizes_only(truth))
    rows = {}
    for noise in ("low",) if args.small else ("low", "medium"):
        if "sizes" not in args.parts:
            break
        folders = [render(program, args, noise, seed, args.out / "truth.json", f"capture{seed}")
                   for seed in range(args.captures)]
        out = args.out / f"found_{noise}"
        rows[noise] = calibrate(args, program, truth, folders, out, "--devices", devices,
                                "--max-tracks", args.tracks)
        show(noise, rows[noise])
    if "guesses" in args.parts:
        rows["guesses"] = from_guesses(args, program, truth, "low")
    if "failures" in args.parts:
        rows["failures"] = break_captures(args, program, truth, "low")
    (args.out / "rows.json").write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
