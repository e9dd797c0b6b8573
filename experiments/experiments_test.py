#!/usr/bin/python3
"""What the experiments compute themselves, against what is known exactly."""

import tempfile
import unittest
from pathlib import Path

import numpy as np

import common
import fig7_hand
import shapes
import table1_cube


class CubeTest(unittest.TestCase):
    def setUp(self):
        self.rig = table1_cube.fig6_rig()
        self.camera = self.rig["cameras"][0]
        random = np.random.default_rng(1)
        a = np.radians(table1_cube.TURN)
        turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
        flat = random.uniform(-80, 80, size=(2, 500, 2))
        half = table1_cube.EDGE / 2
        first = np.c_[np.full(500, half), flat[0]] @ turn.T
        second = np.insert(flat[1], 1, -half, axis=1) @ turn.T
        self.points = np.concatenate([first, second])
        self.face = np.repeat([0, 1], 500)

    def test_faces_are_told_apart_by_their_pixels(self):
        pixels = common.project(self.camera, self.points)
        np.testing.assert_array_equal(table1_cube.face_of_pixels(self.camera, pixels), self.face)

    def test_exact_points_have_a_right_angle_and_no_residual(self):
        figures = table1_cube.plane_figures(self.points, self.face, common.center_of(self.camera))
        self.assertAlmostEqual(figures["angle_deg"], 90, places=6)
        self.assertLess(figures["rmse"], 1e-12)

    def test_noise_along_the_normals_is_the_rmse(self):
        random = np.random.default_rng(2)
        eye = common.center_of(self.camera)
        noisy = self.points + random.normal(0, 0.5, self.points.shape)
        figures = table1_cube.plane_figures(noisy, self.face, eye)
        expected = 0.5 / np.linalg.norm(self.points - eye, axis=1).mean()
        self.assertAlmostEqual(figures["rmse"] / expected, 1, delta=0.1)  # 1000 samples: 2 %


class CalibrationErrorTest(unittest.TestCase):
    def test_every_device_is_off_by_the_pixels_asked_for(self):
        rig = table1_cube.fig6_rig()
        probe = np.random.default_rng(3).normal(size=(500, 3))
        probe *= 0.7 * rig["volume"]["radius"] / np.linalg.norm(probe, axis=1, keepdims=True)
        squares = []
        for seed in range(20):
            wrong = common.with_calibration_error(rig, 2, seed)
            for kind in ("cameras", "projectors"):
                for a, b in zip(rig[kind], wrong[kind]):
                    off = common.project(a, probe) - common.project(b, probe)
                    squares.append(np.mean(np.sum(off**2, 1)))
        # Turn and shift add up or cancel in one draw, not on average.
        self.assertAlmostEqual(np.sqrt(np.mean(squares)), 2, delta=0.3)

    def test_the_seed_decides(self):
        rig = table1_cube.fig6_rig()
        self.assertEqual(common.with_calibration_error(rig, 1, 5),
                         common.with_calibration_error(rig, 1, 5))
        self.assertNotEqual(common.with_calibration_error(rig, 1, 5),
                            common.with_calibration_error(rig, 1, 6))


class HandTest(unittest.TestCase):
    def points(self, lift):
        """Points on the side of every finger towards +x, `lift` mm off it."""
        result = []
        for start, end, radius in shapes.hand(12)[2].values():
            for s in np.linspace(0, 1, 300):
                result.append(start + s * (end - start) + [radius * (1 - 0.15 * s) + lift, 0, 0])
        kind = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
        return np.array([tuple(p) for p in result], kind)

    def test_points_on_the_fingers_recover_them_and_others_do_not(self):
        fingers = shapes.hand(12)[2]
        self.assertGreater(min(fig7_hand.finger_shares(self.points(0), fingers).values()), 0.99)
        self.assertEqual(max(fig7_hand.finger_shares(self.points(2), fingers).values()), 0)

    def test_parts_are_closed_and_turned_outwards(self):
        vertices, triangles = shapes.capsule((0, 0, 0), (0, 0, 50), 10, around=96, cap=32)
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        volume = np.sum(np.cross(a, b) * c) / 6
        expected = np.pi * 10**2 * 50 + 4 / 3 * np.pi * 10**3
        self.assertAlmostEqual(volume / expected, 1, delta=0.01)


class ObjectsTest(unittest.TestCase):
    def volume(self, vertices, triangles):
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        return np.sum(np.cross(a, b) * c) / 6

    def test_balls_and_knot_are_closed_and_turned_outwards(self):
        ball = self.volume(*shapes.ball((5, 0, 0), 40))
        self.assertAlmostEqual(ball / (4 / 3 * np.pi * 40**3), 1, delta=0.01)
        vertices, triangles = shapes.knot(125, 26)
        self.assertAlmostEqual(np.linalg.norm(vertices, axis=1).max(), 125, delta=1)
        edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]],
                                        triangles[:, [2, 0]]]), axis=1)
        self.assertTrue((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())
        line = vertices.reshape(600, 48, 3).mean(1)
        length = np.linalg.norm(np.roll(line, -1, 0) - line, axis=1).sum()
        self.assertAlmostEqual(self.volume(vertices, triangles) / (np.pi * 13**2 * length), 1, delta=0.02)


class FilesTest(unittest.TestCase):
    def test_a_mesh_comes_back(self):
        vertices, triangles = shapes.cube(10)
        with tempfile.TemporaryDirectory() as folder:
            common.write_ply(Path(folder) / "m.ply", vertices, triangles)
            back, faces = common.read_ply(Path(folder) / "m.ply")
        np.testing.assert_allclose(common.positions(back), vertices, atol=1e-5)
        np.testing.assert_array_equal(faces, triangles)

    def test_rows_of_an_earlier_run_are_kept_when_resumed(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "rows.csv"
            common.Rows(path, ["name", "at"], ["value"]).add(name="a", at=1, value=0.5)
            self.assertTrue(common.Rows(path, ["name", "at"], ["value"], True).has(name="a", at=1))
            self.assertFalse(common.Rows(path, ["name", "at"], ["value"]).has(name="a", at=1))


if __name__ == "__main__":
    unittest.main()
