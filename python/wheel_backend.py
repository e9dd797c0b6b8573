"""Makes the wheel and the source archive of the Python package: a build backend after PEP 517.

The wheel holds what CMake builds (script/build release pencilscan_python), linked with the libraries of
this machine's Debian: it is for this machine and those like it. PENCILSCAN_BUILT_PACKAGE names a folder
build/<preset>/python/pencilscan that is built already.
"""

import base64
import hashlib
import os
import pathlib
import re
import subprocess
import sys
import tarfile
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
TAG = f"cp3{sys.version_info.minor}-cp3{sys.version_info.minor}-linux_x86_64"
FIXED_TIME = (1980, 1, 1, 0, 0, 0)  # equal contents give equal bytes


def _version() -> str:
    return re.search(r"project\(pencilscan VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text())[1]


def _metadata() -> str:
    readme = (ROOT / "docs" / "python.md").read_text()
    return (
        "Metadata-Version: 2.1\n"
        "Name: pencilscan\n"
        f"Version: {_version()}\n"
        "Summary: Entire shapes from one frame of a ring of cameras and projectors\n"
        "License: Apache-2.0\n"
        "Requires-Python: >=3.9\n"
        "Requires-Dist: numpy<2\n"  # pybind11 before 2.12 reads dtypes of NumPy 2 wrong
        "Description-Content-Type: text/markdown\n"
        f"\n{readme}"
    )


def _built_package() -> pathlib.Path:
    built = os.environ.get("PENCILSCAN_BUILT_PACKAGE")
    if built:
        return pathlib.Path(built)
    subprocess.run([ROOT / "script" / "build", "release", "pencilscan_python"], check=True)
    return ROOT / "build" / "release" / "python" / "pencilscan"


def _files() -> dict:
    """What the wheel holds: bytes by path."""
    package = _built_package()
    files = {
        f"pencilscan/{path.name}": path.read_bytes()
        for path in sorted(package.iterdir())
        if path.suffix in (".py", ".pyi", ".so") or path.name == "py.typed"
    }
    if not any(name.endswith(".so") for name in files):
        raise SystemExit(f"{package}: no compiled module; script/build release pencilscan_python makes it")
    info = f"pencilscan-{_version()}.dist-info"
    files[f"{info}/LICENSE"] = (ROOT / "LICENSE").read_bytes()
    files[f"{info}/METADATA"] = _metadata().encode()
    files[f"{info}/WHEEL"] = (
        f"Wheel-Version: 1.0\nGenerator: pencilscan\nRoot-Is-Purelib: false\nTag: {TAG}\n"
    ).encode()
    record = [
        f"{name},sha256={_digest(content)},{len(content)}" for name, content in files.items()
    ]
    files[f"{info}/RECORD"] = ("\n".join([*record, f"{info}/RECORD,,"]) + "\n").encode()
    return files


def _digest(content: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()


def get_requires_for_build_wheel(config_settings=None):
    return []


def get_requires_for_build_sdist(config_settings=None):
    return []


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    name = f"pencilscan-{_version()}-{TAG}.whl"
    files = _files()  # before the wheel exists: what fails leaves none
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, content in files.items():
            entry = zipfile.ZipInfo(path, FIXED_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o755 if path.endswith(".so") else 0o644) << 16
            wheel.writestr(entry, content)
    return name


def build_sdist(sdist_directory, config_settings=None):
    """All files that git knows, and PKG-INFO."""
    folder = f"pencilscan-{_version()}"
    tracked = subprocess.run(
        ["git", "-C", ROOT, "ls-files", "-z"], check=True, capture_output=True
    ).stdout.decode().split("\0")
    info = pathlib.Path(sdist_directory) / "PKG-INFO"
    info.write_text(_metadata())
    name = f"{folder}.tar.gz"
    with tarfile.open(pathlib.Path(sdist_directory) / name, "w:gz", format=tarfile.PAX_FORMAT) as archive:
        for path in filter(None, tracked):
            archive.add(ROOT / path, f"{folder}/{path}", recursive=False)
        archive.add(info, f"{folder}/PKG-INFO")
    info.unlink()
    return name
