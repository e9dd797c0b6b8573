"""A sequence shared out by the built program: over processes of which one is killed, over ssh, by
Slurm with a node that dies (where Slurm is installed: script/bootstrap --cluster). All frames are
there, and every byte is that of one process."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import one_machine_slurm
from files import sums, turn_camera, write_ball, write_png

PROGRAM = os.environ["PENCILSCAN_PROGRAM"]
FRAMES = 310  # seven chunks of 50 frames
SEEN = 62     # every so many frames there is something to see
RECONSTRUCT = ["--no-pictures", "--no-mesh"]
DARK = [bytes(3 * 320)] * 240
FINISHED = ("sequence.csv", "sequence.json")  # what sequence finish writes


def run(*arguments, code=0, **options):
    done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, **options)
    assert done.returncode == code, (arguments, done.returncode, done.stdout, done.stderr)
    return done


class Sequence(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="pencilscan_sequence_")
        os.chmod(cls.folder, 0o755)
        at = lambda name: os.path.join(cls.folder, name)
        run("rig", "ring", "--cameras", "2", "--projectors", "2", "--arc-deg", "60",
            "--camera-width", "320", "--camera-height", "240", "--camera-focal-px", "560",
            "--pitch-px", "24", "--volume-radius-mm", "140", "--out", at("ring.json"))
        write_ball(at("ball.obj"))
        run("simulate", "--rig", at("ring.json"), "--mesh", at("ball.obj"), "--out", at("scene"))
        with open(at("scene/rig.json")) as f:
            names = [camera["name"] for camera in json.load(f)["cameras"]]
        write_png(at("dark.png"), DARK)
        for k in range(FRAMES):
            os.makedirs(at(f"frames/{k:06d}"))
            for name in names if k % SEEN == 0 else names[:1]:
                source = at(f"scene/frames/000000/{name}.png") if k % SEEN == 0 else at("dark.png")
                os.link(source, at(f"frames/{k:06d}/{name}.png"))
        cls.rig, cls.frames = at("scene/rig.json"), at("frames")
        cls.input = ["--rig", cls.rig, "--frames", cls.frames, *RECONSTRUCT]
        run("reconstruct", *cls.input, "--out", at("one"), "--shard", "0/1", code=1)
        cls.one = sums(at("one"), FINISHED)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def at(self, name):
        return os.path.join(self.folder, name)

    def assert_whole(self, out):
        self.assertEqual(sums(out, FINISHED), self.one)
        with open(os.path.join(out, "sequence.csv")) as f:
            rows = list(csv.DictReader(f))
        self.assertEqual(len(rows), FRAMES)
        for k, row in enumerate(rows):
            self.assertEqual(row["state"], "done" if k % SEEN == 0 else "failed")
        self.assertGreater(int(rows[0]["points"]), 300)
        self.assertIn("no curve", rows[1]["remarks"])

    def test_seven_shards(self):
        out = self.at("seven")
        for i in range(7):
            run("reconstruct", *self.input, "--out", out, "--shard", f"{i}/7", code=1)
        finished = run("sequence", "finish", "--out", out, "--json", self.at("seven.json"), code=1)
        self.assertIn("frames 000001 to 000061 failed: ", finished.stderr)
        self.assert_whole(out)

    def submit(self, out, *options, **more):
        return subprocess.Popen(
            [PROGRAM, "sequence", "submit", *options, *self.input, "--out", out],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **more)

    @staticmethod
    def workers_of(pid):
        with open(f"/proc/{pid}/task/{pid}/children") as f:
            return [int(child) for child in f.read().split()]

    def wait_for_frames(self, out, count):
        end = time.time() + 60
        while time.time() < end:
            if os.path.isdir(out) and sum(name.isdigit() for name in os.listdir(out)) >= count:
                return
            time.sleep(0.01)
        self.fail(f"{out} has no {count} frames after a minute")

    def test_local_with_workers_killed(self):
        out = self.at("local")
        submitted = self.submit(out, "--local", "2", "--retries", "3")
        killed = 0
        for count in (20, 120, 220):
            self.wait_for_frames(out, count)
            for worker in self.workers_of(submitted.pid)[:1]:
                os.kill(worker, signal.SIGKILL)
                killed += 1
        text, _ = submitted.communicate(timeout=120)
        self.assertEqual(submitted.returncode, 1, text)  # dark frames have no result
        self.assertGreater(killed, 0)
        self.assertIn("signal 9, it goes on", text)
        self.assert_whole(out)

    def test_local_killed_and_submitted_again(self):
        out = self.at("again")
        submitted = self.submit(out, "--local", "2")
        self.wait_for_frames(out, 60)
        submitted.kill()
        submitted.communicate()
        missing = run("sequence", "finish", "--out", out, code=1)
        self.assertIn("was not made by task 6", missing.stderr)
        # Other options are refused before they take the place of what can go on.
        run("sequence", "submit", "--local", "2", *self.input, "--method", "linear", "--out", out, code=2)
        # Moved, it goes on where it is now.
        moved = self.at("moved")
        os.rename(out, moved)
        os.rename(f"{out}.job", f"{moved}.job")
        run("sequence", "finish", "--out", moved, "--resubmit", code=1)
        self.assertFalse(os.path.exists(out))
        self.assert_whole(moved)

    def test_ssh(self):
        tools = self.at("tools")
        os.makedirs(tools)
        with open(f"{tools}/ssh", "w") as f:
            f.write("#!/bin/sh\nwhile [ $1 = -o ]; do shift 2; done\n"
                    "[ $1 = off ] && echo 'ssh: connect to host off: no route' && exit 255\n"
                    "echo $1 >> $(dirname $0)/hosts\nexec sh -c \"$2\"\n")
        os.chmod(f"{tools}/ssh", 0o755)
        out = self.at("ssh")
        submitted = self.submit(out, "--ssh", "a,off,b",
                                env={**os.environ, "PATH": f"{tools}:{os.environ['PATH']}"})
        text, _ = submitted.communicate(timeout=120)
        self.assertIn("on off: the host is lost, it gets no more", text)
        with open(f"{tools}/hosts") as f:
            hosts = f.read().split()
        self.assertEqual(len(hosts), 7)
        self.assertEqual(set(hosts), {"a", "b"})
        self.assert_whole(out)

    def test_bad_input_is_said_at_once(self):
        out = self.at("bad")
        done = run("sequence", "submit", *self.input, "--out", out, code=2)
        self.assertIn("exactly one must be given", done.stderr)
        done = run("sequence", "submit", "--limit", "3", "--sbatch=--partition=long", *self.input,
                   "--out", out, code=2)
        self.assertIn("--limit has no effect here: it needs --slurm", done.stderr)
        self.assertIn("--sbatch has no effect here: it needs --slurm", done.stderr)
        done = run("sequence", "finish", "--out", self.at("scene"), "--rounds", "2", code=2)
        self.assertIn("--rounds has no effect here: it needs --resubmit", done.stderr)
        run("sequence", "finish", "--out", self.at("scene"), code=2)
        run("sequence", "finish", "--out", self.at("one"), "--resubmit", code=2)
        os.makedirs(out)
        with open(f"{out}/mine.txt", "w") as f:
            f.write("something else")
        done = run("sequence", "submit", "--local", "2", *self.input, "--out", out, code=2)
        self.assertIn("must be new, empty or the output of the same inputs", done.stderr)
        self.assertEqual(os.listdir(out), ["mine.txt"])

    @unittest.skipUnless(one_machine_slurm.is_possible(), "no Slurm (script/bootstrap --cluster)")
    def test_slurm_with_a_node_that_dies(self):
        out = self.at("slurm")
        slurm = one_machine_slurm.Slurm(self.at("cluster"))
        try:
            slurm.start()
            submitted = self.submit(out, "--slurm", "--limit", "3", "--retries", "1",
                                    env=slurm.environment)
            text, _ = submitted.communicate(timeout=60)
            self.assertEqual(submitted.returncode, 0, text)
            self.wait_for_frames(out, 10)
            slurm.kill_node("n2")
            table = os.path.join(out, "sequence.csv")

            def is_over():
                slurm.start_again_at_once()
                return os.path.exists(table) and not slurm.run("squeue", "-h").stdout.strip()

            slurm.wait_for(is_over, "the end", 400)
            self.assert_whole(out)
        finally:
            slurm.stop()


class BumpedCamera(unittest.TestCase):
    """A ball that moves by half a millimetre a frame; from the 12th frame on the second of two
    cameras stands where it was bumped to by half a pixel."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="pencilscan_bumped_")
        at = cls.at
        run("rig", "ring", "--cameras", "2", "--projectors", "2", "--arc-deg", "90",
            "--camera-width", "320", "--camera-height", "240", "--camera-focal-px", "560",
            "--pitch-px", "24", "--volume-radius-mm", "140", "--out", at("ring.json"))
        write_ball(at("ball.obj"))
        with open(at("ring.json")) as f:
            ring = json.load(f)
        turn_camera(ring, "cam1", 0.5)
        with open(at("bumped.json"), "w") as f:
            json.dump(ring, f)
        for rig, scene, frames in ("ring", "before", "12"), ("bumped", "after", "16"):
            run("simulate", "--rig", at(f"{rig}.json"), "--mesh", at("ball.obj"), "--noise",
                "medium", "--translate-mm", "0.5", "0", "0", "--samples", "2", "--frame-count",
                frames, "--seed", frames, "--out", at(scene))
        os.makedirs(at("frames"))
        for k in range(16):
            os.symlink(at(f"{'before' if k < 12 else 'after'}/frames/{k:06d}"),
                       at(f"frames/{k:06d}"))

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    @classmethod
    def at(cls, name):
        return os.path.join(cls.folder, name)

    def test_finish_names_camera_and_frame(self):
        out = self.at("out")
        run("reconstruct", "--rig", self.at("ring.json"), "--frames", self.at("frames"), "--out",
            out, *RECONSTRUCT)
        finished = run("sequence", "finish", "--out", out)
        self.assertIn("from frame 000012: camera cam1 moved", finished.stderr)
        with open(f"{out}/sequence.json") as f:
            events = json.load(f)["events"]
        # The frames say it, too, without its name.
        self.assertEqual(
            [(e["frame"], e["last_frame"], e["figure"], e.get("device")) for e in events],
            [("000012", "000015", "crossings", "cam1"), ("000012", "000015", "rig-is-off", None)])
        with open(f"{out}/sequence.csv") as f:
            for row in csv.DictReader(f):
                self.assertGreater(float(row["proj1.line_height"]), 0)

    def check(self, rig, frames, code):
        run("rig", "check", "--rig", rig, "--frames", frames, "--json", self.at("fit.json"),
            "--put-back", self.at("put_back.json"), "--overwrite", code=code)
        with open(self.at("fit.json")) as f:
            return json.load(f)

    def test_rig_check_names_the_camera_and_accuses_nobody_else(self):
        frames = self.at("before/frames")
        fit = self.check(self.at("ring.json"), frames, 0)
        self.assertEqual((fit["verdict"], fit["moved"]), ("fits", []))
        fit = self.check(self.at("bumped.json"), frames, 1)
        self.assertEqual((fit["verdict"], fit["moved"]), ("one moved", ["cam1"]))
        self.assertAlmostEqual(fit["devices"][1]["off_by_px"], 0.5, delta=0.1)
        self.assertLess(fit["after"]["median_px"], 0.2 * fit["before"]["median_px"])
        fit = self.check(self.at("put_back.json"), frames, 0)
        self.assertEqual(fit["verdict"], "fits")

    def test_rig_check_says_between_which_frames_a_camera_moved(self):
        fit = self.check(self.at("ring.json"), self.at("frames"), 1)
        self.assertEqual((fit["verdict"], fit["moved"]), ("moved meanwhile", ["cam1"]))
        before, after = fit["periods"]
        # Of 16 frames, eight are looked at.
        self.assertEqual((before["first_frame"], before["last_frame"], before["verdict"]),
                         ("000000", "000010", "fits"))
        self.assertEqual((after["first_frame"], after["last_frame"], after["verdict"]),
                         ("000012", "000015", "one moved"))
        self.assertEqual(after["moved_before"], "cam1")
        self.assertAlmostEqual(after["moved_before_px"], 0.5, delta=0.1)
        # What is put back is how the rig stands now.
        fit = self.check(self.at("put_back.json"), self.at("after/frames"), 0)
        self.assertEqual(fit["verdict"], "fits")

    def test_rig_check_without_light_knows_nothing(self):
        dark = self.at("dark/000000")
        os.makedirs(dark)
        for name in ("cam0", "cam1"):
            write_png(f"{dark}/{name}.png", DARK)
        fit = self.check(self.at("ring.json"), self.at("dark"), 1)
        self.assertEqual(fit["verdict"], "unknown")


if __name__ == "__main__":
    unittest.main(verbosity=2)
