#!/usr/bin/python3
"""Against what one would take instead: accuracy, completeness, pictures needed, time.

Cube (two cameras, two projectors of table1_cube): OpenCV's structured_light and `pencilscan scan` on
the same Gray-code captures, joint on one frame. Bunny (six + six, one frame): visual hull of the
silhouettes, COLMAP with the true poses on the pattern-lit pictures, joint. Needs Debian's
python3-opencv; COLMAP is left out where it is not installed. Run table1_cube.py and fig5_bunny.py first.
"""

import shutil
import sqlite3
import subprocess
import time

import numpy as np

import common

FIGURES = ["points", "distance_median_mm", "distance_p90_mm", "share_above_2mm", "completeness_1mm",
           "f_score_1mm"]


def write_points(path, points):
    """Vertices alone, which `evaluate` does not take for a mesh."""
    kind = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("u", "<f4"), ("v", "<f4"),
                     ("camera", "u1"), ("projector", "u1"), ("line", "<u2")])
    data = np.zeros(len(points), kind)
    for k, name in enumerate("xyz"):
        data[name] = points[:, k]
    fields = "".join(f"property {t} {n}\n" for t, n in
                     [("float", "x"), ("float", "y"), ("float", "z"), ("float", "u"), ("float", "v"),
                      ("uchar", "camera"), ("uchar", "projector"), ("ushort", "line")])
    header = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{fields}"
              "end_header\n")
    path.write_bytes(header.encode() + data.tobytes())


def matrix(d):
    return np.asarray(d["K"]) @ np.c_[np.asarray(d["R"]), np.asarray(d["t"])]


def opencv_structured_light(rig, captures, step=2):
    """Decode and triangulation as in OpenCV's own sample: white against black makes the mask, decoded
    panel pixels are taken as they are."""
    import cv2
    points = []
    for projector in rig["projectors"]:
        code = cv2.structured_light.GrayCodePattern_create(projector["width"], projector["height"])
        for camera in rig["cameras"]:
            folder = captures / projector["name"] / camera["name"]
            images = [cv2.imread(str(f), cv2.IMREAD_GRAYSCALE) for f in sorted(folder.glob("*.png"))]
            if not images:
                continue
            white, black, *codes = images
            lit = np.zeros_like(white, bool)
            lit[::step, ::step] = True
            lit &= white.astype(int) - black.astype(int) > 20
            seen, shown = [], []
            for y, x in np.argwhere(lit):
                wrong, pixel = code.getProjPixel(codes, int(x), int(y))
                if not wrong:
                    seen.append((x, y))
                    shown.append(pixel)
            if not seen:
                continue
            x = cv2.triangulatePoints(matrix(camera), matrix(projector),
                                      np.array(seen, float).T, np.array(shown, float).T)
            points.append((x[:3] / x[3]).T)
    return np.concatenate(points)


def visual_hull(rig, frames, cells=192):
    """Voxels that no silhouette excludes, as the mesh of their outer faces. Silhouettes: what is lit,
    closed over the dark between lines."""
    import cv2
    radius = rig["volume"]["radius"]
    axis = (np.arange(cells) + 0.5) / cells * 2 * radius - radius
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    inside = np.ones(len(grid), bool)
    for camera in rig["cameras"]:
        image = cv2.imread(str(frames / f"{camera['name']}.png")).max(2)
        lit = (cv2.GaussianBlur(image, (0, 0), 1.5) > 12).astype(np.uint8)
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (21, 21))
        mask = cv2.morphologyEx(lit, cv2.MORPH_CLOSE, disc).astype(bool)
        at = np.round(common.project(camera, grid[inside])).astype(int)
        valid = (at >= 0).all(1) & (at < [camera["width"], camera["height"]]).all(1)
        hit = np.ones(len(at), bool)  # what a camera does not see, it does not exclude
        hit[valid] = mask[at[valid, 1], at[valid, 0]]
        inside[np.flatnonzero(inside)[~hit]] = False
    solid = np.pad(inside.reshape(cells, cells, cells), 1)
    size, vertices, triangles = 2 * radius / cells, [], []
    for k in range(3):
        u, v = np.eye(3)[(k + 1) % 3] * size / 2, np.eye(3)[(k + 2) % 3] * size / 2
        for sign in (1, -1):
            at = np.argwhere(solid & ~np.roll(solid, -sign, k)) - 1
            middle = axis[at] + np.eye(3)[k] * sign * size / 2
            corners = [middle - u - v, middle + u - v, middle + u + v, middle - u + v][::sign]
            first = sum(map(len, vertices)) + 4 * np.arange(len(at))[:, None]
            vertices.append(np.stack(corners, 1).reshape(-1, 3))
            triangles += [first + [0, 1, 2], first + [0, 2, 3]]
    return np.concatenate(vertices), np.concatenate(triangles)


def quaternion(R):
    """w x y z of a rotation matrix."""
    K = np.array([[R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
                  [R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
                  [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1], 0],
                  [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], np.trace(R)]]) / 3
    x, y, z, w = np.linalg.eigh(K)[1][:, 3]
    return np.array([w, x, y, z]) * (1 if w >= 0 else -1)


def colmap_points(rig, frames, folder):
    """Sparse points of COLMAP with the true poses (dense stereo needs CUDA)."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "known").mkdir(parents=True)
    database = folder / "database.db"
    first = rig["cameras"][0]
    K = first["K"]

    def colmap(*words):
        subprocess.run(["colmap", *map(str, words)], check=True, capture_output=True)

    colmap("feature_extractor", "--database_path", database, "--image_path", frames,
           "--ImageReader.single_camera", 1, "--ImageReader.camera_model", "PINHOLE",
           "--ImageReader.camera_params", f"{K[0][0]},{K[1][1]},{K[0][2]},{K[1][2]}",
           "--SiftExtraction.use_gpu", 0)
    colmap("exhaustive_matcher", "--database_path", database, "--SiftMatching.use_gpu", 0)
    ids = dict(sqlite3.connect(database).execute("select name, image_id from images"))
    lines = []
    for camera in rig["cameras"]:
        name = camera["name"] + ".png"
        pose = [*quaternion(np.asarray(camera["R"])), *camera["t"]]
        lines.append(f"{ids[name]} {' '.join(map(str, pose))} 1 {name}\n\n")
    (folder / "known/images.txt").write_text("".join(lines))
    (folder / "known/cameras.txt").write_text(
        f"1 PINHOLE {first['width']} {first['height']} {K[0][0]} {K[1][1]} {K[0][2]} {K[1][2]}\n")
    (folder / "known/points3D.txt").write_text("")
    (folder / "sparse").mkdir()
    colmap("point_triangulator", "--database_path", database, "--image_path", frames, "--input_path",
           folder / "known", "--output_path", folder / "sparse")
    colmap("model_converter", "--input_path", folder / "sparse", "--output_path", folder / "sparse",
           "--output_type", "TXT")
    rows = [line.split()[1:4] for line in (folder / "sparse/points3D.txt").read_text().splitlines()
            if not line.startswith("#")]
    return np.array(rows, float).reshape(-1, 3)


def run(args):
    program = common.Program(args)
    rows = common.Rows(args.out / "results.csv", ["object", "method"],
                       ["pictures", "seconds", *FIGURES])

    def judge(what, method, scene, rig, result, pictures, seconds):
        figures = program("evaluate", "--truth", scene / "truth/mesh.ply", "--rig", rig, "--result",
                          result)
        rows.add(object=what, method=method, pictures=pictures, seconds=round(seconds, 1),
                 **{k: figures.get(k) for k in FIGURES})
        common.progress(f"others: {what}, {method}")

    cube = args.inputs / "table1_cube"
    scene, rig_path = cube / "captures", cube / "rig.json"
    rig = common.json.loads(rig_path.read_text())
    count = len(list((scene / "captures").rglob("*.png")))
    start = time.time()
    points = opencv_structured_light(rig, scene / "captures")
    seconds = time.time() - start
    write_points(args.out / "opencv.ply", points)
    judge("cube", "OpenCV structured_light", scene, rig_path, args.out / "opencv.ply", count, seconds)
    start = time.time()
    program("scan", "--captures", scene / "captures", "--rig", rig_path, "--out", args.out / "scan",
            "--overwrite", "--no-mesh")
    judge("cube", "pencilscan scan", scene, rig_path, args.out / "scan/points.ply", count,
          time.time() - start)
    start = time.time()
    program("reconstruct", "--rig", rig_path, "--frames", scene / "frames", "--out", args.out / "cube",
            "--overwrite", "--no-pictures")
    judge("cube", "pencilscan joint", scene, rig_path, args.out / "cube/000000", 2, time.time() - start)

    scene = args.inputs / "fig5_bunny/scene"
    rig_path, frames = scene / "rig.json", scene / "frames/000000"
    rig = common.json.loads(rig_path.read_text())
    start = time.time()
    common.write_ply(args.out / "hull.ply", *visual_hull(rig, frames))
    judge("bunny", "visual hull", scene, rig_path, args.out / "hull.ply", 6, time.time() - start)
    if shutil.which("colmap"):
        start = time.time()
        points = colmap_points(rig, frames, args.out / "colmap")
        seconds = time.time() - start
        if len(points) > 10:
            write_points(args.out / "colmap.ply", points)
            judge("bunny", "COLMAP sparse", scene, rig_path, args.out / "colmap.ply", 6, seconds)
        else:
            rows.add(object="bunny", method="COLMAP sparse", pictures=6, seconds=round(seconds, 1),
                     points=len(points))
    start = time.time()
    program("reconstruct", "--rig", rig_path, "--frames", scene / "frames", "--out",
            args.out / "bunny", "--overwrite", "--no-pictures")
    judge("bunny", "pencilscan joint", scene, rig_path, args.out / "bunny/000000", 6,
          time.time() - start)
    digits = {"points": 0, "share_above_2mm": 3, "distance_median_mm": 3, "distance_p90_mm": 3}
    common.print_table(args.out / "table.md", "Against others",
                       ["object", "method", "pictures", "seconds", *FIGURES],
                       [[r["object"], r["method"], r["pictures"], r["seconds"],
                         *[common.number(r[k], digits.get(k, 3)) if r[k] != "" else "-"
                           for k in FIGURES]] for r in rows.rows])


if __name__ == "__main__":
    arguments = common.arguments("others", __doc__, inputs=(str(common.ROOT / "out/experiments"), ""))
    arguments.inputs = common.Path(arguments.inputs)
    run(arguments)
