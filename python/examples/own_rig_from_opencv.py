"""Devices that OpenCV calibrated become a rig, which is checked by a frame that it reconstructs.

    python3 own_rig_from_opencv.py [rig.json to write]

OpenCV (python3-opencv) gives, for every device, what `calibrateCamera` and `solvePnP` return: camera
matrix, distortion (k1, k2, p1, p2, k3), and the rotation vector and translation of the world in the
device. Here they come from the views that simulated devices have of a board.
"""

import sys

import cv2
import numpy as np

import pencilscan as ps

# What the laboratory has: four cameras, four projectors. Its true rig is only used to see a board.
lab = ps.ring(4, 4, camera_size=(640, 480), camera_focal_px=1150, pitch_px=24, line_width_px=8)
truth = lab.to_dict()

# A board of 9 x 7 corners, 30 mm apart, in the middle of the ring, turned to each device.
board = np.zeros((63, 3), np.float32)
board[:, :2] = (np.mgrid[0:9, 0:7].T.reshape(-1, 2) - (4, 3)) * 30


def seen_by(device: dict, board_in_world: np.ndarray) -> np.ndarray:
    """Pixels of the board's corners, (63, 2)."""
    rotation, _ = cv2.Rodrigues(np.array(device["R"]))
    pixels, _ = cv2.projectPoints(
        board_in_world, rotation, np.array(device["t"]), np.array(device["K"]), np.zeros(5)
    )
    return pixels.reshape(-1, 2).astype(np.float32)


def turned(device: dict, tilt: np.ndarray) -> np.ndarray:
    """The board in the world, facing the device but for a tilt (rotation vector)."""
    facing = np.array(device["R"]).T
    return (board @ (facing @ cv2.Rodrigues(tilt)[0]).T).astype(np.float32)


def calibrated(device: dict) -> dict:
    """A device as OpenCV finds it: intrinsics from tilted boards, the pose from one of known place."""
    tilts = [np.array(t, float) for t in ((0, 0, 0), (0.5, 0, 0), (0, 0.5, 0), (-0.4, 0.3, 0.2))]
    views = [seen_by(device, turned(device, tilt)) for tilt in tilts]
    error, K, distortion, _, _ = cv2.calibrateCamera(
        [board] * len(views), views, (device["width"], device["height"]), None, None
    )
    placed = turned(device, tilts[1])
    _, rotation, translation = cv2.solvePnP(placed, views[1], K, distortion)
    print(f"{device['name']}: {error:.4f} px")
    return {
        **device,
        "K": K.tolist(),
        "distortion": distortion.ravel()[:5].tolist(),
        "R": cv2.Rodrigues(rotation)[0].tolist(),
        "t": translation.ravel().tolist(),
    }


# The rest of a rig is what it shows and where the object stands: `lab` has both.
rig = ps.Rig({
    **truth,
    "cameras": [calibrated(camera) for camera in truth["cameras"]],
    "projectors": [calibrated(projector) for projector in truth["projectors"]],
})

# A frame of the laboratory, reconstructed with the rig that OpenCV found.
frame = ps.simulate(lab, ps.make_sphere(120, 64))
figures = ps.evaluate(frame.truth, lab, ps.reconstruct(rig, frame, mesh=False))
print(f"labels wrong: {100 * figures['label_error']:.2f} %")
print(f"median distance: {figures['distance_median_mm']:.3f} mm")

if len(sys.argv) > 1:
    rig.write(sys.argv[1])
