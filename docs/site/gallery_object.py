"""Writes the object of the gallery, a ball with bulges: gallery_object.py FILE"""

import sys

import numpy as np

import pencilscan as ps

ball = ps.make_sphere(1, rings=96)
x, y, z = ball.vertices.T
turn = np.arctan2(y, x)
radius_mm = 95 * (1 + 0.18 * np.sin(3 * turn) * (1 - z**2) + 0.12 * np.cos(4 * np.arcsin(np.clip(z, -1, 1))))
ps.Mesh(ball.vertices * radius_mm[:, None], ball.faces).write(sys.argv[1])
