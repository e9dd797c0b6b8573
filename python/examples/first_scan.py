"""A first scan without devices: a simulated ring takes one frame of a mesh, and the shape comes back.

    python3 first_scan.py [mesh] [folder for the result]
"""

import sys

import numpy as np

import pencilscan as ps

# Six cameras and six projectors around a ball, or around a mesh of yours. Small pictures and coarse
# lines make it quick; ps.ring() alone is the full size.
rig = ps.ring(cameras=6, projectors=6, camera_size=(640, 480), camera_focal_px=1150,
              pitch_px=24, line_width_px=8)
mesh = ps.read_mesh(sys.argv[1]) if len(sys.argv) > 1 else ps.make_sphere(120, rings=64)

# What the cameras would see: {"cam0": (height, width, 3) uint8, ...}, with noise and crosstalk.
frame = ps.simulate(rig, mesh, noise="medium", seed=1, fit=len(sys.argv) > 1)

# Which line is each curve, where is each point, which surface is it?
result = ps.reconstruct(rig, frame)
points = result.points
print(f"{len(points)} points, {len(result.mesh.faces)} faces")
for number, name in enumerate(rig.cameras):
    print(f"  {name}: {np.count_nonzero(points.camera == number)} points")

# How far are the points from the true surface?
figures = ps.evaluate(frame.truth, rig, result)
print(f"labels wrong: {100 * figures['label_error']:.2f} %")
print(f"median distance: {figures['distance_median_mm']:.3f} mm")
print(f"found within 1 mm: {100 * figures['completeness_1mm']:.1f} %")

if len(sys.argv) > 2:
    result.write(sys.argv[2])  # points.ply, mesh.ply and the others
