"""A small scene that the program itself makes, its commands, and how they end."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time

from whole import Broken, check_whole

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from files import all_files, sums, write_ball

WIDTH, HEIGHT = 320, 240
RING = ["--cameras", "4", "--projectors", "4", "--camera-width", str(WIDTH), "--camera-height",
        str(HEIGHT), "--camera-focal-px", "560", "--projector-width", "256", "--projector-height",
        "200", "--projector-focal-px", "350", "--pitch-px", "8", "--line-width-px", "3",
        "--offset-px", "4", "--volume-radius-mm", "140"]


class Done:
    """How a command ended. `code` < 0: by this signal."""

    def __init__(self, code, output, error, seconds):
        self.code, self.output, self.error, self.seconds = code, output, error, seconds

    @property
    def lines(self):
        return [line for line in self.error.splitlines() if line]

    def complaint(self, *parts):
        """The last line, which says why it ended; it holds the parts."""
        if self.code not in (1, 2):
            raise Broken(f"ended with {self.code}: {self.lines[-1:]}")
        last = self.lines[-1] if self.lines else ""
        if not last.startswith("pencilscan: "):
            raise Broken(f"its last line is no complaint: {last!r}")
        for part in parts:
            if part not in self.error:
                raise Broken(f"{part!r} is not in its complaint: {last!r}")
        return last

    def succeeded(self):
        if self.code != 0:
            raise Broken(f"ended with {self.code}: {self.lines[-1:]}")
        return self


def size(folder):
    return sum(map(os.path.getsize, all_files(folder)))


class Command:
    """A command that reads a folder of inputs and fills one of output. `again`: what goes on after an
    interruption; `result`: of the inputs, what it adds to; `expected`: the sums of what it makes
    undisturbed."""

    def __init__(self, scene, name, arguments, again=lambda out: [], result=None):
        self.scene, self.name, self.arguments, self.again = scene, name, arguments, again
        self.result, self.expected, self.seconds, self.bytes = result, None, 0, 0

    def learn(self):
        out = self.prepare(self.scene.new(f"undisturbed/{self.name}"))
        there = size(out)
        self.seconds = self.run(out).succeeded().seconds
        check_whole(out, True)
        self.expected = sums(out)
        self.bytes = size(out) - there

    def prepare(self, out, inputs=None):
        if self.result:
            shutil.copytree(f"{inputs or self.scene.inputs}/{self.result}", out)
        return out

    def start(self, out, inputs=None, more=(), **options):
        arguments = self.arguments(inputs or self.scene.inputs, out)
        return self.scene.start([*arguments, *more], **options)

    def run(self, out, inputs=None, more=(), **options):
        return self.scene.wait(*self.start(out, inputs, more, **options))

    def go_on(self, out):
        """The same once more, as a person would; it ends well, and all is as if undisturbed."""
        self.run(out, more=self.again(out)).succeeded()
        self.is_right(out)

    def is_right(self, out):
        check_whole(out, True)
        found = sums(out)
        if found != self.expected:
            wrong = sorted(k for k in found.keys() | self.expected.keys()
                           if found.get(k) != self.expected.get(k))
            raise Broken(f"differs from an undisturbed run in {wrong[:5]}")


class Scene:
    """Inputs of all commands in one folder, so that a copy of it can be spoilt."""

    def __init__(self, program, folder, small):
        self.program, self.folder, self.small = os.path.abspath(program), folder, small
        shutil.rmtree(folder, ignore_errors=True)
        os.makedirs(folder)
        self.inputs = self.at("inputs")
        ring, ball = self.at("ring.json"), self.at("ball.obj")
        self.do("rig", "ring", *RING, "--out", ring)
        write_ball(ball)
        self.do("simulate", "--rig", ring, "--mesh", ball, "--noise", "low", "--frame-count", "3",
                "--translate-mm", "3", "0", "0", "--samples", "2", "--gray-code", "--out",
                self.inputs)
        shutil.move(ball, self.inputs)
        with open(f"{self.inputs}/rig.json") as f:
            self.cameras = [camera["name"] for camera in json.load(f)["cameras"]]
        for k in range(60):
            os.makedirs(f"{self.inputs}/many/{k:06d}")
            for camera in self.cameras:
                os.link(f"{self.inputs}/frames/{k % 3:06d}/{camera}.png",
                        f"{self.inputs}/many/{k:06d}/{camera}.png")
        if not small:
            self.do("reconstruct", "--rig", f"{self.inputs}/rig.json", "--frames",
                    f"{self.inputs}/frames", "--out", f"{self.inputs}/result", "--no-pictures")

    def at(self, name):
        return os.path.join(self.folder, name)

    def new(self, name):
        """The path of a folder that is not there."""
        path = self.at(name)
        shutil.rmtree(path, ignore_errors=True)
        return path

    def copied_inputs(self):
        """Links: what changes there has to be replaced, not written into."""
        return shutil.copytree(self.inputs, self.new("spoilt"), copy_function=os.link)

    def do(self, *arguments):
        return self.wait(*self.start(arguments)).succeeded()

    def starts(self, limits):
        return self.wait(*self.start(["--version"], limits)).code == 0

    def start(self, arguments, limits=(), environment=None):
        """`limits`: (of resource, value)."""
        def limit():
            for kind, value in limits:
                resource.setrlimit(kind, (value, value))
        logs = open(self.at("stdout"), "w+"), open(self.at("stderr"), "w+")
        process = subprocess.Popen([self.program, *arguments], stdout=logs[0], stderr=logs[1],
                                   preexec_fn=limit, start_new_session=True,
                                   env={**os.environ, **(environment or {})})
        return process, logs, time.time()

    def wait(self, process, logs, began, seconds=300):
        try:
            code = process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.kill_all(process, logs)
            raise Broken(f"hangs: no end after {seconds} s") from None
        took, texts = time.time() - began, []
        for log in logs:
            with log:
                log.seek(0)
                texts.append(log.read())
        return Done(code, *texts, took)

    @staticmethod
    def kill_all(process, logs=()):
        """With the processes that it started."""
        for log in logs:
            log.close()
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        process.wait()

    def commands(self, names):
        """Those that are asked for, by name, after one undisturbed run each."""
        points = ["--no-mesh", "--no-pictures"]
        if_there = lambda name: lambda out: (
            ["--overwrite"] if os.path.exists(os.path.join(out, name)) else [])
        found = [
            Command(self, "reconstruct", lambda inputs, out: [
                "reconstruct", "--rig", f"{inputs}/rig.json", "--frames", f"{inputs}/frames",
                "--out", out, *points]),
            Command(self, "reconstruct, all output", lambda inputs, out: [
                "reconstruct", "--rig", f"{inputs}/rig.json", "--frames", f"{inputs}/frames",
                "--out", out, "--depth-maps", "--mesh-formats", "obj,stl,glb"]),
            Command(self, "calibrate", lambda inputs, out: [
                "calibrate", "--captures", f"{inputs}/captures", "--devices",
                f"{inputs}/rig.json", "--known-distance", "cam0", "cam1", "850", "--out",
                f"{out}/rig.json"], if_there("rig.json")),
            Command(self, "simulate", lambda inputs, out: [
                "simulate", "--rig", f"{inputs}/rig.json", "--mesh", f"{inputs}/ball.obj",
                "--frame-count", "2", "--samples", "1", "--truth-maps", "--out", out],
                if_there("rig.json")),
            Command(self, "sequence submit", lambda inputs, out: [
                "sequence", "submit", "--local", "2", "--rig", f"{inputs}/rig.json", "--frames",
                f"{inputs}/many", "--out", f"{out}/result", *points]),
            Command(self, "sequence finish", lambda inputs, out: [
                "sequence", "finish", "--out", out], result="result"),
            Command(self, "sequence export", lambda inputs, out: [
                "sequence", "export", "--result", f"{inputs}/result", "--zarr",
                f"{out}/surface.zarr", "--usd", f"{out}/film.usda"], if_there("surface.zarr")),
        ]
        chosen = {command.name: command for command in found if command.name in names}
        for command in chosen.values():
            command.learn()
        return chosen
