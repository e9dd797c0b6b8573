#!/usr/bin/python3
"""What the experiments compute themselves, against what is known exactly."""

import argparse
import contextlib
import inspect
import io
import os
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np

import acceptance
import capture_mistakes
import common
import fig7_hand
import heldout
import knocked
import lateral_color
import shapes
import solids
import statues
import table1_cube


class CommandTest(unittest.TestCase):
    def test_what_documents_call_as_a_command_is_one(self):
        scripts = [p for p in common.ROOT.glob("experiments/*.py") if "__main__" in p.read_text()]
        self.assertGreater(len(scripts), 10)
        self.assertEqual([p.name for p in scripts if not os.access(p, os.X_OK)], [])


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


def edge_counts(triangles):
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]),
                    axis=1)
    return np.unique(edges, axis=0, return_counts=True)[1]


class SolidsTest(unittest.TestCase):
    def test_the_surface_of_a_ball_is_closed_and_lies_on_it(self):
        vertices, triangles = solids.mesh_of(solids.ellipsoid((1, 2, 3), (30, 30, 30)), (-35,) * 3,
                                             (40,) * 3, 1.5)
        self.assertLess(np.abs(np.linalg.norm(vertices - [1, 2, 3], axis=1) - 30).max(), 1e-3)
        self.assertTrue((edge_counts(triangles) == 2).all())
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        # A facet of 1.5 mm lies up to 1.5^2 / (8 * 30) mm below the ball: .1 % of its volume.
        self.assertAlmostEqual(np.sum(np.cross(a, b) * c) / 6 / (4 / 3 * np.pi * 30**3), 1, delta=2e-3)

    def test_bounds_of_distance_miss_no_part_far_from_the_middle_of_a_block(self):
        thin = solids.rod((-30, -3, 4), (31, 5, 2), 1.2)
        vertices, triangles = solids.mesh_of(thin, (-40, -20, -20), (40, 20, 20), 0.8)
        self.assertLess(vertices[:, 0].min(), -30.9)
        self.assertGreater(vertices[:, 0].max(), 31.9)
        self.assertTrue((edge_counts(triangles) == 2).all())

    def test_statues_are_turned_outwards_and_nearly_everywhere_of_one_sheet(self):
        for make in (statues.bent_hand, statues.part, statues.person, statues.dragon):
            vertices, triangles = make(2)
            a, b, c = (vertices[triangles[:, k]] for k in range(3))
            self.assertGreater(np.sum(np.cross(a, b) * c), 0, make.__name__)
            counts = edge_counts(triangles)
            self.assertEqual(counts.min(), 2, make.__name__)
            # Two sheets may pass one cell of the lattice: an edge of four facets.
            self.assertLess((counts > 2).mean(), 1e-3, make.__name__)


class HeldOutTest(unittest.TestCase):
    def test_the_splits_have_no_object_and_no_setting_in_common(self):
        fit, held = ({s.object for s in heldout.SPLITS[k].values()} for k in ("fit", "held"))
        self.assertFalse(fit & held)
        self.assertFalse(heldout.SPLITS["fit"].keys() & heldout.SPLITS["held"].keys())

    def test_a_scaled_rig_takes_the_same_pictures(self):
        rig = table1_cube.fig6_rig()
        scaled = heldout.scaled_rig(rig, 0.01)
        points = np.random.default_rng(1).normal(size=(20, 3)) * 50
        for kind in ("cameras", "projectors"):
            for a, b in zip(rig[kind], scaled[kind]):
                np.testing.assert_allclose(common.project(a, points), common.project(b, 0.01 * points))

    def test_a_scaled_result_keeps_all_but_lengths(self):
        kind = [(n, "<f4") for n in "xyz"] + [("camera", "u1"), ("sigma", "<f4")]
        points = np.array([(1, 2, 3, 4, 0.5), (5, 6, 7, 8, 0.25)], kind)
        header = "ply\nformat binary_little_endian 1.0\nelement vertex 2\n" + "".join(
            f"property {'uchar' if n == 'camera' else 'float'} {n}\n" for n, _ in kind) + "end_header\n"
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "p.ply"
            path.write_bytes(header.encode() + points.tobytes())
            heldout.scale_ply(path, path, 10)
            back, _ = common.read_ply(path)
        np.testing.assert_allclose(common.positions(back), 10 * common.positions(points))
        np.testing.assert_allclose(back["sigma"], [5, 2.5])
        np.testing.assert_array_equal(back["camera"], [4, 8])

    def test_sure_points_are_judged_by_what_they_say(self):
        figures = {"right_by_confidence": [{"confidence": 0.9, "right": 0.5, "points": 100},
                                           {"confidence": 0.9995, "right": 0.998, "points": 1000}]}
        wrong, said, points = heldout.confident_wrong(figures)
        self.assertAlmostEqual(wrong, 0.002)
        self.assertAlmostEqual(said, 0.0005)
        self.assertFalse(self.are_sure_in_bounds(wrong, said, points))

    def test_one_wrong_sure_point_and_none_at_all_are_within_bounds(self):
        figures = {"right_by_confidence": [{"confidence": 0.9997, "right": 0.998, "points": 500}]}
        self.assertTrue(self.are_sure_in_bounds(*heldout.confident_wrong(figures)))
        self.assertTrue(self.are_sure_in_bounds(*heldout.confident_wrong({})))
        self.assertFalse(self.are_sure_in_bounds("", "", ""))

    def are_sure_in_bounds(self, wrong, said, points):
        row = {"sure_wrong": wrong, "sure_said": said, "sure_points": points}
        return all(heldout.in_bounds(row, key, bound) for key, *_, bound in heldout.COLUMNS if key in row)

    def test_a_scaled_scene_is_compared_with_what_the_unscaled_one_gave(self):
        keys = ["label_error", *heldout.SCALE_INVARIANT]
        row = dict.fromkeys(keys, 0.5)
        self.assertEqual(heldout.missed_by_scaling(row, row), [])
        self.assertEqual(heldout.missed_by_scaling({**row, "label_error": 0.5003}, row), ["label_error"])
        self.assertEqual(heldout.missed_by_scaling(row, {**row, "sigma_below_1": ""}), ["sigma_below_1"])
        self.assertEqual(heldout.missed_by_scaling(row, {**row, "sigma_below_1": 0.51}), ["sigma_below_1"])

    def test_a_scaled_scene_whose_unscaled_one_failed_has_no_reference(self):
        with tempfile.TemporaryDirectory() as folder:
            rows = common.Rows(Path(folder) / "r.csv", ["scene", "seed", "scale"], ["kind", *[c[0] for c in heldout.COLUMNS]])
            rows.add(scene="bust", seed=1, scale=1, kind="plain")
            rows.add(scene="bust", seed=1, scale=0.01, kind="plain", **{c[0]: 0.5 for c in heldout.COLUMNS})
            with contextlib.redirect_stdout(io.StringIO()) as table:
                heldout.table(argparse.Namespace(out=Path(folder), split="held"), rows)
        self.assertIn("1 missed", table.getvalue())

    def test_a_scene_is_rendered_anew_once_the_code_of_an_object_changed(self):
        scene = heldout.SPLITS["fit"]["horse"]
        before = heldout.fingerprint(scene, 1)
        self.assertEqual(heldout.fingerprint(scene, 1), before)
        for changed in (heldout.objects, heldout.statues, heldout.solids, heldout.shapes):
            source = inspect.getsource
            with mock.patch("inspect.getsource", lambda of: source(of) + "#" * (of is changed)):
                self.assertNotEqual(heldout.fingerprint(scene, 1), before, changed.__name__)

    def test_edges_of_one_and_of_four_facets_are_found(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "m.ply"
            vertices, triangles = shapes.cube(10)
            common.write_ply(path, vertices, triangles)
            self.assertEqual(heldout.open_edges(path), 0)
            common.write_ply(path, vertices, triangles[1:])
            self.assertEqual(heldout.open_edges(path), 3)
            common.write_ply(path, vertices, np.concatenate([triangles, triangles[:1]]))
            self.assertEqual(heldout.open_edges(path), 3)

    def test_an_object_stands_in_its_volume_and_a_person_keeps_his_size(self):
        volume = {"center": [10, 0, 0], "radius": 170}
        vertices, _ = heldout.placed(heldout.SPLITS["fit"]["balls"], 1, volume)
        self.assertAlmostEqual(np.linalg.norm(vertices - [10, 0, 0], axis=1).max(), 0.95 * 170, places=6)
        vertices, _ = heldout.placed(heldout.SPLITS["held"]["person"], 1, {"center": [0, 0, 0], "radius": 950})
        self.assertAlmostEqual(np.ptp(vertices[:, 2]), 1702, delta=15)


class KnockedTest(unittest.TestCase):
    def test_a_projector_that_is_knocked_by_nothing_is_rolled_all_the_same(self):
        rig = table1_cube.fig6_rig()
        wrong, name = knocked.knocked(rig, "projectors", 0, 5, 1)
        for before, after in zip(rig["projectors"], wrong["projectors"]):
            turn = np.asarray(after["R"]) @ np.asarray(before["R"]).T
            angle = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
            self.assertAlmostEqual(angle, 5 if before["name"] == name else 0, places=5)
            np.testing.assert_allclose(common.center_of(after), common.center_of(before), atol=1e-9)
        self.assertEqual(knocked.knocked(rig, "cameras", 0, "", 1)[0], rig)


class MirrorTest(unittest.TestCase):
    def test_every_device_shows_and_sees_the_mirrored_picture(self):
        rig = table1_cube.fig6_rig()
        vertices, triangles = shapes.cube(100)
        mirrored, (turned, _) = capture_mistakes.in_mirror(rig, (vertices, triangles))
        for kind in ("cameras", "projectors"):
            for before, after in zip(rig[kind], mirrored[kind]):
                self.assertAlmostEqual(np.linalg.det(after["R"]), 1)
                expected = common.project(before, vertices) * [-1, 1] + [before["width"] - 1, 0]
                np.testing.assert_allclose(common.project(after, turned), expected, atol=1e-9)


class LateralColorTest(unittest.TestCase):
    def test_scenes_of_another_rig_mesh_or_noise_are_other_ones(self):
        with tempfile.TemporaryDirectory() as folder:
            rig, mesh = (Path(folder) / name for name in ("rig.json", "mesh.ply"))
            origins = []
            for rig_text, mesh_text, noise in (("a", "b", "low"), ("c", "b", "low"), ("a", "d", "low"), ("a", "b", "medium")):
                rig.write_text(rig_text)
                mesh.write_text(mesh_text)
                origins.append(lateral_color.origin(rig, mesh, ["--noise", noise]))
        self.assertEqual(len(set(origins)), 4)


class AcceptanceTest(unittest.TestCase):
    def test_artefacts_have_their_size_and_lie_in_the_volume(self):
        makers = [make for make, _, _ in acceptance.ARTEFACTS.values()]
        unmoved = [make(np.eye(3), np.zeros(3))[0] for make in makers]
        for position in range(acceptance.POSITIONS):
            turn, place = acceptance.pose(position)
            np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
            self.assertGreater(np.linalg.det(turn), 0)
            for vertices in unmoved:
                self.assertLess(np.linalg.norm(vertices @ turn.T + place, axis=1).max(), 160)
        for make, vertices in zip(makers, unmoved):
            np.testing.assert_allclose(make(turn, place)[0], vertices @ turn.T + place, atol=1e-9)
        vertices, _ = acceptance.sphere(turn, place)
        np.testing.assert_allclose(np.linalg.norm(vertices - place, axis=1), acceptance.DIAMETER / 2, rtol=1e-6)
        vertices, _ = acceptance.ball_bar(turn, place)
        along = ((vertices - place) @ turn)[:, 1]
        self.assertAlmostEqual(np.ptp(along), acceptance.LENGTH + acceptance.BALL, places=3)
        vertices, _ = acceptance.plate(turn, place)
        np.testing.assert_allclose(np.ptp((vertices - place) @ turn, axis=0), [10, 160, 120])

    def test_speeds_go_from_10_to_500_mm_a_second(self):
        speeds = [np.linalg.norm(acceptance.velocity(k)) for k in range(acceptance.POSITIONS)]
        self.assertAlmostEqual(speeds[0], 10)
        self.assertAlmostEqual(speeds[-1], 500)

    def test_the_worst_is_the_greatest_by_size_and_a_position_without_a_figure_counts(self):
        with tempfile.TemporaryDirectory() as folder:
            rows = common.Rows(Path(folder) / "r.csv", ["position"], ["SD_mm"])
            rows.add(position=0, SD_mm=0.01)
            rows.add(position=1, SD_mm=-0.03)
            self.assertAlmostEqual(acceptance.worst(rows, "SD_mm"), 0.03)
            rows.add(position=2)
            self.assertTrue(np.isnan(acceptance.worst(rows, "SD_mm")))

    def test_two_balls_count_with_their_points(self):
        def ball(count, below):
            return {"left_out": 2, "z": {"count": count, "below_1": below, "below_2": below, "below_3": 1.0,
                                         "rms": 1.0, "greatest": count}}
        row = acceptance.figures_of({"worst": {"SD_mm": -0.1, "points": 5, "coverage": 0.5},
                                     "positions": [{"balls": [ball(300, 0.6), ball(100, 0.8)]}]})
        self.assertAlmostEqual(row["z_below_1"], 0.65)
        self.assertEqual((row["SD_mm"], row["z_count"], row["left_out"]), (-0.1, 400, 4))


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
