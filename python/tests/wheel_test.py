"""The wheel is whole, and what it holds works alone.

Run with PENCILSCAN_BUILT_PACKAGE=build/<preset>/python/pencilscan.
"""

import base64
import hashlib
import importlib.util
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


class WheelTest(unittest.TestCase):
    def setUp(self) -> None:
        self.kept = tempfile.TemporaryDirectory()
        self.addCleanup(self.kept.cleanup)
        self.folder = pathlib.Path(self.kept.name)
        # As `python3 -m build --wheel` does, where Debian's python3-build is there.
        if importlib.util.find_spec("pyproject_hooks") or importlib.util.find_spec("pep517"):
            subprocess.run(
                [sys.executable, "-P", "-m", "build", "--wheel", "--no-isolation",
                 "--outdir", self.folder, ROOT],
                check=True, cwd=self.folder, stdout=subprocess.DEVNULL,
            )
        else:
            script = f"import wheel_backend; wheel_backend.build_wheel({str(self.folder)!r})"
            subprocess.run([sys.executable, "-c", script], check=True, cwd=ROOT / "python")
        self.wheel = next(self.folder.glob("*.whl"))

    def test_record_is_right(self) -> None:
        with zipfile.ZipFile(self.wheel) as wheel:
            names = wheel.namelist()
            record = next(name for name in names if name.endswith("/RECORD"))
            rows = [row.split(",") for row in wheel.read(record).decode().splitlines()]
            self.assertEqual([row[0] for row in rows], names)
            for path, digest, size in rows[:-1]:
                content = wheel.read(path)
                self.assertEqual(int(size), len(content))
                found = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=")
                self.assertEqual(digest, "sha256=" + found.decode())
            self.assertIn("pencilscan/_core.pyi", names)
            self.assertIn("pencilscan/py.typed", names)
            metadata = next(name for name in names if name.endswith("/METADATA"))
            self.assertIn(b"Requires-Dist: numpy<2\n", wheel.read(metadata))

    def test_it_works_where_nothing_else_is(self) -> None:
        site = self.folder / "site"
        with zipfile.ZipFile(self.wheel) as wheel:
            wheel.extractall(site)
        script = (
            "import pencilscan as ps\n"
            "print(ps.__file__, ps.__version__, len(ps.make_sphere(10).faces) > 0)"
        )
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
        printed = subprocess.run(
            [sys.executable, "-c", script], check=True, capture_output=True, text=True,
            env={**environment, "PYTHONPATH": str(site)}, cwd=self.folder,
        ).stdout.split()
        self.assertTrue(printed[0].startswith(str(site)))
        self.assertIn(f"-{printed[1]}-", self.wheel.name)
        self.assertEqual(printed[2], "True")


if __name__ == "__main__":
    unittest.main()
