"""A method of your own decides the line of every curve; everything before and after stays.

    python3 own_labeller.py

The method gets the curves with what the grid says of each (pattern, local ID) and returns labels. This
one goes along the ray of the curve's middle to where surfaces usually are, half a radius before the
volume's centre, and takes the line with the curve's local ID that is nearest there.
"""

import numpy as np

import pencilscan as ps

rig = ps.ring(4, 4, camera_size=(640, 480), camera_focal_px=1150, pitch_px=24, line_width_px=8)
frame = ps.simulate(rig, ps.make_sphere(120, 64))
contents = rig.to_dict()
center, radius = rig.volume


def place_on_ray(camera: dict, u: float, v: float) -> np.ndarray:
    """Where the ray of a pixel is half a radius before the volume's centre. World, mm."""
    K, R, t = (np.array(camera[key]) for key in ("K", "R", "t"))
    direction = np.linalg.solve(K, (u, v, 1))
    depth = (R @ center + t)[2] - radius / 2
    return R.T @ (direction * depth - t)


def line_there(projector: dict, pattern: dict, local_id: int, place: np.ndarray) -> int:
    """The line with this local ID nearest to the projector's pixel of a place."""
    K, R, t = (np.array(projector[key]) for key in ("K", "R", "t"))
    x = K @ (R @ place + t)
    across = 0 if pattern["orientation"] == "vertical" else 1
    number = (x[across] / x[2] - pattern["offset_px"]) / pattern["pitch_px"]
    period = pattern["alphabet"] ** pattern["order"]
    line = local_id + period * round((number - local_id) / period)
    size = projector["height" if across else "width"]
    count = int((size - 0.5 - pattern["offset_px"]) // pattern["pitch_px"]) + 1
    return line if 0 <= line < count else -1


def nearest_line(detection: ps.Detection) -> ps.Labels:
    """One label per curve, for all of its points."""
    curves, grid = detection.curves, detection.grid
    of_point = detection.curve_of_point
    lines = np.full(len(grid), -1)
    for k in range(len(grid)):
        if grid.local_id[k] < 0:
            continue
        points = np.flatnonzero(of_point == k)
        u, v = curves.uv[points[len(points) // 2]]
        projector = contents["projectors"][grid.projector[k]]
        lines[k] = line_there(  # each projector of this ring has one pattern
            projector, projector["pattern"], int(grid.local_id[k]),
            place_on_ray(contents["cameras"][grid.camera[k]], u, v),
        )
    projectors = np.where(lines >= 0, grid.projector, -1)
    return ps.Labels(
        projectors[of_point], grid.pattern[of_point], lines[of_point],
        grid.id_probability[of_point],
    )


for name, method in {"joint": "joint", "nearest line": nearest_line}.items():
    result = ps.reconstruct(rig, frame, method=method, mesh=False)
    figures = ps.evaluate(frame.truth, rig, result)
    print(f"{name}: {len(result.points)} points, {100 * figures['label_error']:.1f} % wrong")

# The same by hand, with the labels before guided matching completes them.
detection = ps.detect(rig, frame, identities=True)
labels = nearest_line(detection)
print(f"{(labels.projector >= 0).mean():.0%} of {len(labels)} curve points labelled")
result = ps.measure(detection, labels, mesh=False, guided=False)
print(f"{len(result.points)} points as labelled")
