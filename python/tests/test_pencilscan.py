"""The package against the program, and what a Python user counts on.

Run with PYTHONPATH=build/<preset>/python and PENCILSCAN_PROGRAM.
"""

import copy
import gc
import inspect
import json
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import numpy as np

import pencilscan as ps
from pencilscan import _core

PROGRAM = os.environ["PENCILSCAN_PROGRAM"]
POINT_PROPERTIES = "x y z u v camera projector pattern line sigma confidence plane nx ny nz red green blue".split()


def small_ring() -> ps.Rig:
    """Small pictures, so that the tests are quick."""
    return ps.ring(
        4, 4, camera_size=(480, 360), camera_focal_px=860, pitch_px=24, line_width_px=8
    )


def address(array: np.ndarray) -> int:
    return array.__array_interface__["data"][0]


def run(*arguments) -> None:
    subprocess.run([PROGRAM, *map(str, arguments)], check=True, capture_output=True)


class Scene:
    """A ball before the ring, by the program and by the package."""

    def __init__(self) -> None:
        self.kept = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.kept.name)
        self.rig = small_ring()
        self.rig.write(self.folder / "rig.json")
        ps.make_sphere(120, 48).write(self.folder / "ball.ply")
        run("simulate", "--rig", self.folder / "rig.json", "--mesh", self.folder / "ball.ply",
            "--noise", "medium", "--out", self.folder / "scene")
        run("reconstruct", "--rig", self.folder / "rig.json", "--depth-maps", "--no-pictures",
            "--frames", self.folder / "scene" / "frames", "--out", self.folder / "out")
        self.frame = ps.simulate(self.rig, self.folder / "ball.ply")
        self.stages: list = []
        self.result = ps.reconstruct(
            self.rig, self.frame, depth_maps=True, progress=self.listen
        )

    def listen(self, stage: str, done: float) -> None:
        self.stages.append((stage, done, threading.get_ident()))


class PackageTest(unittest.TestCase):
    scene: Scene

    @classmethod
    def setUpClass(cls) -> None:
        cls.scene = Scene()

    @classmethod
    def tearDownClass(cls) -> None:
        cls.scene.kept.cleanup()

    # ---- against the program --------------------------------------------------------------------

    def test_files_have_the_programs_bytes(self) -> None:
        ours = self.scene.folder / "ours"
        self.scene.result.write(ours)
        theirs = self.scene.folder / "out" / "000000"
        for name in ("points.ply", "curves.ply", "mesh.ply", "mesh_measured.ply"):
            self.assertEqual((ours / name).read_bytes(), (theirs / name).read_bytes(), name)
        reports = [json.loads((folder / "report.json").read_text()) for folder in (ours, theirs)]
        for camera in reports[1]["cameras"]:
            camera.pop("picture", None)  # a hash of the file that the program read
        self.assertEqual(*reports)

    def test_arrays_have_the_programs_bytes(self) -> None:
        points = self.scene.result.points
        content = (self.scene.folder / "out" / "000000" / "points.ply").read_bytes()
        header, body = content.split(b"end_header\n", 1)
        types = {b"float": "<f4", b"uchar": "u1", b"int": "<i4"}
        fields = [
            (words[2].decode(), types[words[1]])
            for words in (line.split() for line in header.splitlines())
            if words[0] == b"property"
        ]
        stored = np.frombuffer(body, dtype=fields)
        for name in POINT_PROPERTIES:
            self.assertTrue((points[name] == stored[name]).all(), name)
        self.assertEqual((points.normal.shape, points.color.shape), (points.xyz.shape, points.xyz.shape))
        self.assertGreater((np.abs(np.linalg.norm(points.normal, axis=1) - 1) < 1e-5).mean(), 0.9)
        self.assertEqual(points.xyz.dtype, np.float32)
        self.assertEqual(points.xyz.shape, (len(stored), 3))

    def test_whole_numbers_have_the_types_of_the_files(self) -> None:
        result = self.scene.result
        for array in (result.points.line, result.curves.line, result.curves.curve,
                      result.crossings.curve_a, result.crossings.curve_b):
            self.assertEqual(array.dtype, np.int32)
            self.assertFalse(array.flags.writeable)
        self.assertEqual(result.curves.xyz.shape, (len(result.curves), 3))
        self.assertEqual(result.curves.rgb.shape, (len(result.curves), 3))

    def test_every_stage_takes_threads(self) -> None:
        one = ps.simulate(self.scene.rig, self.scene.folder / "ball.ply", threads=1)
        for name, image in self.scene.frame.items():
            self.assertTrue((one[name] == image).all(), name)
        for call in (lambda n: ps.simulate(self.scene.rig, self.scene.frame.truth, threads=n),
                     lambda n: ps.evaluate(self.scene.frame.truth, self.scene.rig, self.scene.result, threads=n),
                     lambda n: ps.calibrate("captures", self.scene.rig, threads=n)):
            self.assertEqual(self.complaint(lambda: call(-1)).field, "threads")

    def test_the_figures_are_the_programs(self) -> None:
        folder = self.scene.folder
        run("evaluate", "--truth", folder / "ball.ply", "--rig", folder / "rig.json", "--result",
            folder / "out" / "000000", "--json", folder / "figures.json")
        theirs = json.loads((folder / "figures.json").read_text())
        self.assertEqual(theirs.pop("format"), "figures/1")
        self.assertEqual(ps.evaluate(folder / "ball.ply", self.scene.rig, folder / "out/000000"), theirs)
        ours = ps.evaluate(folder / "ball.ply", self.scene.rig, self.scene.result)
        self.assertEqual(list(ours), list(theirs))
        self.assertEqual(ours["label_error"], theirs["label_error"])
        self.assertLess(ours["distance_median_mm"], 0.1)

    def test_a_ring_is_the_programs(self) -> None:
        path = self.scene.folder / "ring.json"
        run("rig", "ring", "--cameras", 5, "--projectors", 4, "--arc-deg", 200, "--out", path)
        self.assertEqual(ps.ring(5, 4, arc_deg=200), ps.read_rig(path))
        self.assertEqual(ps.ring(5, 4, arc_deg=200).to_dict(), json.loads(path.read_text()))

    def test_depth_maps_are_the_programs(self) -> None:
        z = self.scene.result.depth["cam1"].z
        self.assertEqual((z.shape, z.dtype), ((360, 480), np.float32))
        import matplotlib.image

        tenths = matplotlib.image.imread(self.scene.folder / "out/000000/depth/cam1.png") * 65535
        theirs = np.round(tenths).astype(int)
        # Tenths of a millimetre; what lies between two of them to a float's rounding may be either.
        tenths_off = np.abs(10 * np.nan_to_num(z).astype(float) - theirs)
        self.assertLessEqual(tenths_off.max(), 0.5 + 1e-3)
        self.assertTrue((np.isfinite(z) == (theirs > 0)).all())
        self.assertGreater(np.isfinite(z).sum(), 10000)
        self.assertTrue((self.scene.result.depth["cam1"].sigma[np.isfinite(z)] > 0).all())

    def test_depth_maps_need_a_mesh(self) -> None:
        for options in ({"mesh": False}, {"depth": False}):
            with self.assertRaisesRegex(ps.InputError, "depth_maps"):
                ps.reconstruct(self.scene.rig, self.scene.frame, depth_maps=True, **options)

    # ---- memory ---------------------------------------------------------------------------------

    def test_results_are_views(self) -> None:
        points = self.scene.result.points
        self.assertEqual(address(points.xyz), address(points.x))
        self.assertEqual(address(points.y) - address(points.x), 4)
        self.assertEqual(address(points.uv), address(points.u))
        mesh = self.scene.result.mesh
        self.assertEqual(address(mesh.vertices), address(mesh.vertices))
        self.assertEqual(address(mesh.faces), address(mesh.faces))
        self.assertEqual(mesh.faces.dtype, np.int32)
        self.assertEqual(mesh.vertices.shape[1], 3)
        self.assertEqual(mesh.sigma.shape, (len(mesh.vertices),))
        self.assertEqual(mesh.color.shape, (len(mesh.vertices), 3))
        z = self.scene.result._core.depth["cam0"][0]
        self.assertEqual(address(z), address(self.scene.result.depth["cam0"].z))

    def test_pictures_are_read_where_they_lie(self) -> None:
        wide = np.zeros((20, 40, 3), np.float32)
        pictures = _core.Pictures({
            "float": wide, "bytes": self.scene.frame["cam0"], "part": wide[:, :30],
            "turned": wide[..., ::-1],
        })
        views = pictures.views()
        self.assertEqual(address(views["float"]), address(wide))
        self.assertEqual(address(views["bytes"]), address(self.scene.frame["cam0"]))
        self.assertEqual(address(views["part"]), address(wide))
        self.assertEqual(views["part"].shape, (20, 30, 3))
        self.assertNotEqual(address(views["turned"]), address(wide))

    def test_arrays_outlive_their_result(self) -> None:
        result = ps.reconstruct(self.scene.rig, self.scene.frame, mesh=False)
        xyz = result.points.xyz
        copy = xyz.copy()
        del result
        gc.collect()
        junk = [np.ones(1 << 20) for _ in range(20)]
        self.assertTrue((xyz == copy).all())
        del junk

    def test_rows_of_floats_may_begin_anywhere(self) -> None:
        picture = np.arange(24, dtype=np.float32).reshape(2, 4, 3) / 24
        rows = np.zeros((2, 49), np.uint8)  # a byte more than a row
        rows[:, :48] = picture.view(np.uint8).reshape(2, 48)
        odd = np.ndarray((2, 4, 3), np.float32, rows, strides=(49, 12, 4))
        self.assertTrue((_core.Pictures({"odd": odd}).views()["odd"] == picture).all())

    def test_tables_can_be_copied(self) -> None:
        points = self.scene.result.points
        for again in (copy.copy(points), copy.deepcopy(points), pickle.loads(pickle.dumps(points))):
            self.assertEqual(again.names, points.names)
            self.assertTrue((again.xyz == points.xyz).all())

    def test_a_result_without_a_mesh_leaves_none_of_an_earlier_one(self) -> None:
        folder = self.scene.folder / "twice"
        self.scene.result.write(folder)
        points = ps.reconstruct(self.scene.rig, self.scene.frame, mesh=False)
        points.write(folder)
        self.assertEqual({path.name for path in folder.iterdir()},
                         {"points.ply", "curves.ply", "report.json"})

    def test_pictures_stay_as_they_are_and_their_type_does_not_matter(self) -> None:
        numbers = {
            name: image.astype(np.float32) * np.float32(1 / 255)
            for name, image in self.scene.frame.items()
        }
        before = {name: image.copy() for name, image in numbers.items()}
        of_numbers = ps.reconstruct(self.scene.rig, numbers, mesh=False)
        of_bytes = ps.reconstruct(self.scene.rig, self.scene.frame, mesh=False)
        self.assertEqual(of_numbers.points.xyz.tobytes(), of_bytes.points.xyz.tobytes())
        for name, image in numbers.items():
            self.assertTrue((image == before[name]).all())

    # ---- stage by stage -------------------------------------------------------------------------

    def test_labels_in_the_middle_may_be_the_callers(self) -> None:
        def without_every_fourth_curve(detection: ps.Detection) -> ps.Labels:
            labels = ps.label(detection)
            keep = (labels.projector >= 0) & (detection.curve_of_point % 4 != 0)
            return ps.Labels(np.where(keep, labels.projector, -1), labels.pattern, labels.line)

        detection = ps.detect(self.scene.rig, self.scene.frame)
        labels = without_every_fourth_curve(detection)
        alone = ps.measure(detection, labels, mesh=False, guided=False).points
        self.assertGreater(len(alone), 5000)
        self.assertLessEqual(len(alone), (labels.projector >= 0).sum())
        footprint_mm = 1100 / 860  # of a pixel; points that nothing smoothed are a fifth of it off
        off = np.abs(np.linalg.norm(alone.xyz, axis=1) - 120)
        self.assertLess(np.median(off), 0.2 * footprint_mm)
        # Guided matching finds the lines of the others on the surface, and depth follows.
        result = ps.reconstruct(
            self.scene.rig, self.scene.frame, method=without_every_fourth_curve
        )
        self.assertGreater(len(result.points), 1.1 * len(alone))
        self.assertGreater(len(result.mesh.faces), 1000)
        figures = ps.evaluate(self.scene.frame.truth, self.scene.rig, result)
        self.assertLess(figures["label_error"], 0.01)

    def test_stages_give_the_names_of_the_whole(self) -> None:
        detection = ps.detect(self.scene.rig, self.scene.frame)
        points = ps.measure(detection, ps.label(detection)).points

        def names(p: ps.Points) -> dict:
            rows = zip(p.camera.tolist(), p.u.tolist(), p.v.tolist(),
                       p.projector.tolist(), p.line.tolist())
            return {row[:3]: row[3:] for row in rows}

        whole, ours = names(self.scene.result.points), names(points)
        both = whole.keys() & ours.keys()
        # Labels do not say which names were tentative: lines found without them lie a little elsewhere.
        self.assertGreater(len(both), 0.9 * len(whole))
        self.assertGreater(len(ours), 0.99 * len(whole))
        self.assertGreater(sum(whole[k] == ours[k] for k in both), 0.999 * len(both))

    def test_stages_are_views_and_fit_each_other(self) -> None:
        detection = ps.detect(self.scene.rig, self.scene.frame, identities=True)
        curves, grid = detection.curves, detection.grid
        self.assertEqual(address(curves.uv), address(detection._core.curves["uv"]))
        self.assertEqual(address(curves.uv), address(curves.u))
        self.assertEqual(address(grid.local_id), address(detection._core.grid["local_id"]))
        labels = ps.label(detection)
        self.assertEqual(address(labels.line), address(labels._core.arrays["line"]))
        of_point = detection.curve_of_point
        self.assertEqual((len(of_point), of_point.max()), (len(curves), len(grid) - 1))
        self.assertTrue((grid.camera[of_point] == curves.camera).all())
        self.assertTrue((grid.curve[of_point] == curves.curve).all())
        self.assertGreater((grid.local_id >= 0).mean(), 0.3)
        self.assertTrue((curves.state == 5).all())
        self.assertEqual(detection.rig, self.scene.rig)

    def test_measuring_twice_gives_the_same(self) -> None:
        detection = ps.detect(self.scene.rig, self.scene.frame)
        labels = ps.label(detection)
        once, again = (ps.measure(detection, labels, mesh=False).points for _ in range(2))
        self.assertEqual(once.xyz.tobytes(), again.xyz.tobytes())

    def test_labels_may_be_a_number_for_all(self) -> None:
        labels = ps.Labels(1, 0, [5, 6, 7])
        self.assertEqual(labels.projector.tolist(), [1, 1, 1])
        self.assertEqual(labels.line.tolist(), [5, 6, 7])

    def test_complaints_about_labels(self) -> None:
        detection = ps.detect(self.scene.rig, self.scene.frame)
        count = len(detection.curves)

        def of(*arrays, **more) -> str:
            return str(self.complaint(
                lambda: ps.measure(detection, ps.Labels(*arrays, **more), mesh=False)))

        zeros = np.zeros(count, int)
        self.assertIn("one for every curve point", of(zeros[1:], zeros[1:], zeros[1:]))
        self.assertIn("projector[0]: 9", of(zeros + 9, zeros, zeros).replace(" = ", ": "))
        self.assertIn("line[0]", of(zeros, zeros, zeros + 10000))
        self.assertIn("confidence[0]", of(zeros, zeros, zeros, confidence=2))
        self.assertIn("confidence[0]", of(zeros, zeros, zeros, confidence=np.nan))
        self.assertIn("whole numbers", of(zeros + 0.5, zeros, zeros))
        self.assertIn("line = 4294967296 to", of(zeros, zeros, zeros + 2**32))
        self.assertIn("shape (1, ", of([zeros], zeros, zeros))
        self.assertIn("must be numbers", of(zeros, zeros, zeros, confidence="high"))
        self.assertIn("identities", str(self.complaint(lambda: ps.label(detection, "multiview"))))
        self.assertIn("pencilscan.Labels", str(self.complaint(
            lambda: ps.reconstruct(self.scene.rig, self.scene.frame, method=lambda d: zeros))))

    # ---- while it runs --------------------------------------------------------------------------

    def test_progress_comes_in_order_in_the_callers_thread(self) -> None:
        done = [entry[1] for entry in self.scene.stages]
        self.assertEqual(done, sorted(done))
        self.assertEqual(self.scene.stages[-1][:2], ("done", 1.0))
        self.assertLess(done[-2], 1)
        self.assertIn("surface", {entry[0] for entry in self.scene.stages})
        self.assertEqual({entry[2] for entry in self.scene.stages}, {threading.get_ident()})

    def test_progress_can_end_the_call(self) -> None:
        with self.assertRaises(ps.Cancelled):
            ps.reconstruct(self.scene.rig, self.scene.frame, progress=lambda *_: False)

        with self.assertRaises(ps.Cancelled):  # False as NumPy has it
            ps.reconstruct(self.scene.rig, self.scene.frame, progress=lambda *_: np.float64(1) < 0)

        def fail(stage: str, done: float) -> None:
            raise KeyError(stage)

        with self.assertRaises(KeyError):
            ps.reconstruct(self.scene.rig, self.scene.frame, progress=fail)

    def test_other_threads_run_meanwhile(self) -> None:
        finished = threading.Event()
        worker = threading.Thread(target=lambda: (
            ps.reconstruct(self.scene.rig, self.scene.frame, mesh=False), finished.set()
        ))
        worker.start()
        turns = 0
        while not finished.is_set():
            turns += 1
            time.sleep(0.001)
        worker.join()
        self.assertGreater(turns, 20)  # a locked interpreter would have given none or one

    def test_ctrl_c_ends_the_call(self) -> None:
        script = (
            "import pencilscan as ps, signal\n"
            "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # shells ignore it in the background
            f"rig = ps.read_rig({str(self.scene.folder / 'rig.json')!r})\n"
            "frame = ps.simulate(rig, ps.make_sphere(120, 48))\n"
            "print('ready', flush=True)\n"
            "try:\n"
            "    while True: ps.reconstruct(rig, frame)\n"
            "except KeyboardInterrupt:\n"
            "    print('interrupted')\n"
        )
        child = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        self.addCleanup(child.kill)
        self.assertEqual(child.stdout.readline(), "ready\n")
        time.sleep(0.5)
        child.send_signal(signal.SIGINT)
        rest, _ = child.communicate(timeout=120)
        self.assertEqual((rest, child.returncode), ("interrupted\n", 0))

    def test_a_daemon_thread_at_work_does_not_keep_a_program_from_its_end(self) -> None:
        script = (
            "import pencilscan as ps, threading\n"
            f"rig = ps.read_rig({str(self.scene.folder / 'rig.json')!r})\n"
            "frame = ps.simulate(rig, ps.make_sphere(120, 48))\n"
            "begun = threading.Event()\n"
            "def work():\n"
            "    while True: ps.reconstruct(rig, frame, progress=lambda *_: begun.set())\n"
            "threading.Thread(target=work, daemon=True).start()\n"
            "begun.wait()\n"
            "print('the end')\n"
        )
        child = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True,
                               timeout=120)
        self.assertEqual((child.stdout, child.stderr, child.returncode), ("the end\n", "", 0))

    # ---- complaints -----------------------------------------------------------------------------

    def complaint(self, call) -> ps.InputError:
        with self.assertRaises(ps.InputError) as caught:
            call()
        self.assertNotIn("\n", str(caught.exception))
        return caught.exception

    def test_complaints_name_file_field_value_and_rule(self) -> None:
        path = self.scene.folder / "bad.json"
        contents = self.scene.rig.to_dict()
        contents["cameras"][1]["K"][0][0] = -1
        path.write_text(json.dumps(contents))
        error = self.complaint(lambda: ps.read_rig(path))
        self.assertEqual((error.file, error.field), (str(path), "cameras[1].K[0][0]"))
        self.assertEqual(float(error.value), -1)
        self.assertIn("> 0", error.rule)
        self.assertIsInstance(error, ValueError)
        self.assertEqual(self.complaint(lambda: ps.Rig(contents)).field, "cameras[1].K[0][0]")

    def test_arguments_of_a_wrong_type_are_named(self) -> None:
        rig, frame = self.scene.rig, self.scene.frame
        for options in ({"method": None}, {"threads": 2.5}, {"threads": -1},
                        {"multiview_cost": 3}, {"frame": 1}):
            error = self.complaint(lambda: ps.reconstruct(rig, frame, **options))
            self.assertEqual((error.file, error.field), ("options", *options))
        for options in ({"cameras": 2.5}, {"projectors": "2"}, {"order": 1.5}):
            error = self.complaint(lambda: ps.ring(**options))
            self.assertEqual((error.file, error.field), ("ring", *options))
        self.assertEqual(self.complaint(lambda: ps.Rig([1])).value, "[1]")

    def test_a_rig_may_hold_arrays(self) -> None:
        contents = self.scene.rig.to_dict()
        for device in contents["cameras"]:
            device["width"] = np.int64(device["width"])
            for key in ("K", "R", "t"):
                device[key] = np.array(device[key])
        self.assertEqual(ps.Rig(contents), self.scene.rig)
        contents["cameras"][1]["t"][2] = np.nan
        error = self.complaint(lambda: ps.Rig(contents))
        self.assertEqual((error.field, error.rule), ("cameras[1].t[2]", "must be finite"))

    def test_pictures_of_another_byte_order_are_read(self) -> None:
        wide = {name: image.astype(np.uint16) * 257 for name, image in self.scene.frame.items()}
        swapped = {name: image.astype(">u2") for name, image in wide.items()}
        for name, view in _core.Pictures(wide).views().items():
            self.assertTrue((ps._rig.as_pictures(self.scene.rig, swapped).views()[name] == view).all())

    def test_complaints_can_be_sent_to_another_process(self) -> None:
        # A worker of a multiprocessing.Pool whose error cannot be read lets its caller wait forever.
        error = self.complaint(lambda: ps.read_rig("nowhere.json"))
        for again in (pickle.loads(pickle.dumps(error)), copy.copy(error)):
            self.assertEqual(str(again), str(error))
            self.assertEqual((again.file, again.rule), (error.file, error.rule))

    def test_paths_are_those_of_the_system(self) -> None:
        rig, folder = self.scene.rig, os.fsencode(self.scene.folder)
        for path in (os.path.join(folder, b"\xff.json"), os.fsdecode(folder + b"/\xfe.json")):
            rig.write(path)
            self.assertEqual(ps.read_rig(path), rig)
        missing = os.fsdecode(folder + b"/\xfd.json")
        self.assertEqual(self.complaint(lambda: ps.read_rig(missing)).file, missing)
        ball = os.path.join(folder, b"ball.ply")
        self.assertEqual(len(ps.simulate(rig, ball)), 4)
        for call in (rig.write, ps.read_rig, ps.read_mesh, ps.make_sphere(10).write):
            self.assertIn("zero byte", self.complaint(lambda: call("a\0b")).rule)

    def test_complaints_about_pictures(self) -> None:
        rig, frame = self.scene.rig, self.scene.frame

        def of(**images):
            return str(self.complaint(lambda: ps.reconstruct(rig, images)))

        self.assertIn("cam7", of(cam7=frame["cam0"]))
        self.assertIn("20x10: must be 480x360", of(cam0=np.zeros((10, 20, 3), np.uint8)))
        self.assertIn("(height, width, 3)", of(cam0=np.zeros((360, 480, 4), np.uint8)))
        self.assertIn("[0, 1]", of(cam0=frame["cam0"].astype(np.float32)))
        self.assertIn("int64", of(cam0=frame["cam0"].astype(np.int64)))
        self.assertIn("(height, width)", of(cam0="image.png"))
        masked = np.ma.masked_greater(frame["cam0"], 200)
        masked[0, 0] = np.ma.masked
        self.assertIn("masked", of(cam0=masked))
        for call in (ps.reconstruct, ps.detect):
            for none in ([None] * 4, {}, {"cam0": None}):
                self.assertIn("at least one", str(self.complaint(lambda: call(rig, none))))
        self.assertIn("plain: cam0", str(self.complaint(
            lambda: ps.reconstruct(rig, frame, plain={"cam0": frame["cam0"][:10]}))))
        self.assertIn("plain: cam0", str(self.complaint(
            lambda: ps.reconstruct(rig, frame, plain={"cam0": frame["cam0"] > 0}))))
        self.assertIn("name of a camera", str(self.complaint(
            lambda: ps.reconstruct(rig, {0: frame["cam0"]}))))
        for call in (ps.reconstruct, ps.detect):
            self.assertIn("threads = -1", str(self.complaint(lambda: call(rig, frame, threads=-1))))
        with self.assertRaises(ps.StageError):
            ps.reconstruct(rig, {"cam0": np.zeros((360, 480, 3), np.uint8)})
        with self.assertRaises(TypeError):
            ps.reconstruct(rig, frame, metod="joint")
        self.assertIn("must be joint", str(self.complaint(
            lambda: ps.reconstruct(rig, frame, method="magic"))))

    def test_pictures_may_be_a_list_in_the_rigs_order(self) -> None:
        rig, frame = self.scene.rig, self.scene.frame
        named = ps.reconstruct(rig, frame, mesh=False)
        listed = ps.reconstruct(rig, [frame[name] for name in rig.cameras], mesh=False)
        np.testing.assert_array_equal(listed.points.xyz, named.points.xyz)
        first = {name: image for name, image in frame.items() if name != rig.cameras[-1]}
        without = ps.reconstruct(rig, [first.get(name) for name in rig.cameras], mesh=False)
        np.testing.assert_array_equal(
            without.points.xyz, ps.reconstruct(rig, first, mesh=False).points.xyz)
        self.assertIn("length = 1: must be", str(self.complaint(
            lambda: ps.reconstruct(rig, [frame["cam0"]]))))
        self.assertIn("must be a dict", str(self.complaint(
            lambda: ps.reconstruct(rig, frame["cam0"]))))

    def test_complaints_about_meshes_and_options(self) -> None:
        far = ps.Mesh(ps.make_sphere(10).vertices + 1e5, ps.make_sphere(10).faces)
        self.assertIn("view", str(self.complaint(lambda: ps.simulate(self.scene.rig, far))))
        self.assertIn("index", str(self.complaint(lambda: ps.Mesh(np.eye(3), [[0, 1, 3]]))))
        self.assertIn("(n, 3)", str(self.complaint(lambda: ps.Mesh(np.eye(2), [[0, 1, 1]]))))
        wrapped = np.array([[0, 1, 2 + 2**32]])
        self.assertIn("indices", str(self.complaint(lambda: ps.Mesh(np.eye(3), wrapped))))
        ball = ps.make_sphere(100)
        for array in (ball.faces, ball.vertices):  # what was checked stays as it was
            with self.assertRaises(ValueError):
                array[0, 0] = 10**8
        for options in ({"seed": -1}, {"seed": 2**64}, {"frame": 2**31}, {"rotate_deg": np.inf},
                        {"translate_mm": (np.nan, 0, 0)}):
            self.assertIn("must", str(self.complaint(
                lambda: ps.simulate(self.scene.rig, ball, **options))), options)
        self.assertIn("medium", str(self.complaint(
            lambda: ps.simulate(self.scene.rig, ps.make_sphere(100), noise="loud"))))
        for options in ({"noise": 0.1}, {"up": 2}):
            self.assertIn("a name in quotes", str(self.complaint(
                lambda: ps.simulate(self.scene.rig, ball, **options))), options)
        self.assertIn("colours^order", str(self.complaint(lambda: ps.ring(order=30))))
        self.assertIn("green", str(self.complaint(lambda: ps.ring(colors=(("mauve", "blue"),)))))
        for colors in (((),), (("blue", "cyan"), ()), ("blue", "cyan")):
            self.assertIn("lists", str(self.complaint(lambda: ps.ring(colors=colors))), colors)
        self.assertIn("finite", str(self.complaint(lambda: ps.make_sphere(np.inf))))
        self.assertIn("2048", str(self.complaint(lambda: ps.make_sphere(10, 10**6))))
        for options in ({"seed": -1}, {"max_tracks": -1}, {"seed": 1.5}):
            self.assertIn("whole number", str(self.complaint(
                lambda: ps.calibrate("captures", self.scene.rig, **options))), options)
        for option, value in (("focal_tolerance", 101), ("center_tolerance", np.nan)):
            error = self.complaint(
                lambda: ps.calibrate("captures", self.scene.rig, **{option: value}))
            self.assertEqual((error.file, error.field), ("options", option))
        self.assertIn("whole number", str(self.complaint(
            lambda: ps.evaluate(ball, self.scene.rig, self.scene.result, seed=-1))))

    # ---- the rest -------------------------------------------------------------------------------

    def test_help_shows_defaults(self) -> None:
        for name in ps.__all__:
            self.assertTrue(inspect.getdoc(getattr(ps, name)), name)
        parameters = inspect.signature(ps.reconstruct).parameters
        self.assertEqual(parameters["method"].default, "joint")
        self.assertIn("height, width", ps.reconstruct.__doc__)
        self.assertTrue((pathlib.Path(ps.__file__).parent / "_core.pyi").exists())

    def test_a_rig_can_be_sent_to_another_process(self) -> None:
        self.assertEqual(pickle.loads(pickle.dumps(self.scene.rig)), self.scene.rig)
        self.assertEqual(self.scene.rig.cameras, ["cam0", "cam1", "cam2", "cam3"])
        self.assertEqual(self.scene.rig.volume, ((0, 0, 0), 170))

    def test_meshes_go_in_and_out(self) -> None:
        ball = ps.make_sphere(50)
        again = ps.Mesh(ball.vertices, ball.faces)
        self.assertTrue((again.vertices == ball.vertices).all())
        self.assertAlmostEqual(again.volume_mm3, 4 / 3 * np.pi * 50**3, delta=5000)
        directions = ball.vertices / 50
        self.assertGreater((again.normals * directions).sum(axis=1).min(), 0.98)
        path = self.scene.folder / "ball.stl"
        again.write(path)
        self.assertEqual(len(ps.read_mesh(path).faces), len(ball.faces))
        again.unit_known = False
        again.write(self.scene.folder / "ball.obj")
        self.assertIn("unit unknown", (self.scene.folder / "ball.obj").read_text()[:200])
        self.assertTrue(self.scene.result.mesh.unit_known)

    def test_an_unknown_unit_is_said(self) -> None:
        rig = ps.Rig({**self.scene.rig.to_dict(), "unit": "unknown"})
        frame = ps.simulate(rig, ps.make_sphere(120, 48))
        frame.truth.write(self.scene.folder / "unitless.ply")
        self.assertIn(b"unit unknown", (self.scene.folder / "unitless.ply").read_bytes()[:200])
        for name in ("again.ply", "again.obj", "again.stl"):
            ps.read_mesh(self.scene.folder / "unitless.ply").write(self.scene.folder / name)
            self.assertFalse(ps.read_mesh(self.scene.folder / name).unit_known, name)
        self.assertTrue(ps.read_mesh(self.scene.folder / "ball.ply").unit_known)
        figures = ps.evaluate(frame.truth, rig, self.scene.result)
        self.assertIn("the rig's unit is unknown", figures["warnings"][0])

    def test_calibration_gives_a_rig(self) -> None:
        folder = self.scene.folder / "calibration"
        folder.mkdir()
        rig = ps.ring(3, 3, arc_deg=150, camera_size=(320, 240), camera_focal_px=575,
                      projector_size=(320, 256), projector_focal_px=607)
        rig.write(folder / "rig.json")
        ps.make_sphere(120, 24).write(folder / "ball.ply")
        run("simulate", "--gray-code", "--samples", 2, "--rig", folder / "rig.json", "--mesh",
            folder / "ball.ply", "--out", folder / "scene")
        run("calibrate", "--captures", folder / "scene" / "captures", "--devices",
            folder / "rig.json", "--out", folder / "calibrated.json")
        stages: list = []
        captures = folder / "scene" / "captures"
        found = ps.calibrate(captures, rig,
                             progress=lambda stage, done: stages.append(stage))
        self.assertEqual((folder / "calibrated.json").read_text(), found._core.text())
        self.assertEqual(found.verdict, "good")
        for again in (pickle.loads(pickle.dumps(found)), copy.copy(found)):
            self.assertEqual(again, found)
            self.assertEqual((again.verdict, again.reasons, again.figures, again.report),
                             (found.verdict, found.reasons, found.figures, found.report))
        self.assertLess(found.figures["rms_px"], 0.2)
        # K that is stated without a tolerance is kept to the last digit.
        exact = ps.calibrate(captures, rig, focal_tolerance=0, center_tolerance=0)
        self.assertEqual([camera["K"] for camera in exact.to_dict()["cameras"]],
                         [camera["K"] for camera in rig.to_dict()["cameras"]])
        self.assertIn("decoding", stages)
        self.assertIsInstance(found, ps.Rig)
        error = self.complaint(lambda: ps.calibrate(captures, rig, board="chess"))
        self.assertEqual((error.file, error.field, error.value), ("options", "board", "chess"))
        self.assertEqual(self.complaint(lambda: ps.calibrate(folder / "no", rig)).file, "captures")
        # Two folders of a projector that were exchanged: the reason names the argument.
        pair = captures / "proj1"
        for old, new in (("cam0", "kept"), ("cam1", "cam0"), ("kept", "cam1")):
            (pair / old).rename(pair / new)
        try:
            said = " ".join(ps.calibrate(captures, rig).reasons)
        except ps.StageError as error:
            said = str(error)
        self.assertNotIn("--", said)


if __name__ == "__main__":
    unittest.main()
