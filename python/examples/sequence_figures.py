"""Figures of a sequence: an object moves through the ring, and each frame is measured and drawn.

    python3 sequence_figures.py [figures.png]
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import pencilscan as ps

FRAMES = 4

rig = ps.ring(4, 4, camera_size=(480, 360), camera_focal_px=860, pitch_px=24, line_width_px=8)
ball = ps.make_sphere(100, 48)

rows = []
for number in range(FRAMES):
    # The ball moves 12 mm to the side from frame to frame.
    seen = ps.simulate(rig, ball, frame=number, translate_mm=(12, 0, 0), seed=1 + number)
    result = ps.reconstruct(rig, seen, frame=f"{number:06}")
    figures = ps.evaluate(seen.truth, rig, result)
    rows.append({
        "points": len(result.points),
        "median distance, mm": figures["distance_median_mm"],
        "found within 1 mm": figures["completeness_1mm"],
        "centre of the surface, x, mm": result.mesh.vertices[:, 0].mean(),
    })
    print(f"frame {number}:", ", ".join(f"{name} {value:.4g}" for name, value in rows[-1].items()))

# What moved 12 mm a frame was measured to move 12 mm a frame.
steps = np.diff([row["centre of the surface, x, mm"] for row in rows])
print(f"moved {steps.mean():.2f} mm a frame")

figure, axes = plt.subplots(len(rows[0]), sharex=True, figsize=(6, 8))
for axis, name in zip(axes, rows[0]):
    axis.plot([row[name] for row in rows], marker="o")
    axis.set_title(name, loc="left")
axes[-1].set_xlabel("frame")
figure.tight_layout()
if len(sys.argv) > 1:
    figure.savefig(sys.argv[1])
