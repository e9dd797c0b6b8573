"""Rigs: cameras, projectors and what they show."""

from __future__ import annotations

import json
import math
import os
from typing import Any, Callable, Mapping, Optional, Union

import numpy as np

from . import _core
from ._errors import InputError

PathLike = Union[str, "os.PathLike[str]"]
Progress = Callable[[str, float], Optional[bool]]


def path_of(path: PathLike) -> bytes:
    """A path as the system takes it: its text need not be UTF-8."""
    if not isinstance(path, (str, bytes, os.PathLike)):
        raise InputError("path", "", f"{path!r}"[:80], "must be a path")
    name = os.fsencode(path)
    if b"\0" in name:
        raise InputError(os.fsdecode(name), "", "", "must be a path: without a zero byte")
    return name


def rig_text(rig: dict) -> str:
    """A dictionary with the keys of rig.json as text; NumPy's arrays and numbers become lists and numbers."""

    def plain(value: Any, field: str) -> Any:
        if isinstance(value, (np.ndarray, np.generic)):
            value = value.tolist()
        if isinstance(value, dict):
            return {key: plain(v, f"{field}.{key}" if field else str(key)) for key, v in value.items()}
        if isinstance(value, (list, tuple)):
            return [plain(v, f"{field}[{i}]") for i, v in enumerate(value)]
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError("rig", field, str(value), "must be finite")
        if not isinstance(value, (str, int, float, type(None))):
            raise InputError("rig", field, f"{value!r}"[:80], "must be what rig.json can hold")
        return value

    return json.dumps(plain(rig, ""))


def check_whole(file: str, name: str, value: Any, first: int, last: int) -> None:
    """InputError unless `value` is a whole number from `first` to `last`."""
    if not isinstance(value, (int, np.integer)) or not first <= value <= last:
        raise InputError(file, name, str(value), f"must be a whole number from {first} to {last}")


def check_range(name: str, value: int, last: int) -> None:
    """InputError unless 0 <= value <= last, before the library says it in terms of its own."""
    check_whole("options", name, value, 0, last)


def check_threads(threads: int) -> None:
    check_range("threads", threads, 2**31 - 1)


def check_name(name: str, value: Any) -> None:
    """InputError unless an option is a text."""
    if not isinstance(value, str):
        raise InputError("options", name, f"{value!r}"[:80], "must be a name in quotes")


def finished(progress: Any) -> None:
    """Tells `progress` that everything is done; its answer can end nothing any more."""
    if progress is not None:
        progress("done", 1.0)


class Rig:
    """All cameras and projectors with their patterns: rig.json as a value.

    Lengths are mm, angles radians, `x_device = R x_world + t`; pixel centres are at whole numbers.
    """

    def __init__(self, rig: Union[dict, str, PathLike]) -> None:
        """From a dictionary with the keys of rig.json, or the path of such a file.

        Matrices and vectors may be NumPy arrays.
        """
        if isinstance(rig, dict):
            self._core = _core.Rig(rig_text(rig), "rig")
        else:
            self._core = _core.read_rig(path_of(rig))

    @classmethod
    def _of(cls, core: Any) -> "Rig":
        rig = cls.__new__(cls)
        rig._core = core
        return rig

    @property
    def cameras(self) -> list[str]:
        """The names of the cameras; `points.camera` holds places in this list."""
        return self._core.cameras

    @property
    def projectors(self) -> list[str]:
        """The names of the projectors; `points.projector` holds places in this list."""
        return self._core.projectors

    @property
    def volume(self) -> tuple[tuple[float, float, float], float]:
        """Centre (x, y, z) and radius, mm, of the sphere that holds the object."""
        *center, radius = self._core.volume()
        return tuple(center), radius

    def to_dict(self) -> dict:
        """The contents of rig.json."""
        return json.loads(self._core.text())

    def write(self, path: PathLike) -> None:
        """Writes rig.json, whole or not at all; replaces a file that is there."""
        self._core.write(path_of(path))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Rig) and self._core.text() == other._core.text()

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self):
        return _unpickled, (self.to_dict(),)

    def __repr__(self) -> str:
        return (
            f"<pencilscan.{type(self).__name__}: {len(self.cameras)} cameras, {len(self.projectors)} projectors>"
        )


def _unpickled(contents: dict) -> Rig:
    return Rig(contents)


def as_rig(rig: Union[Rig, dict, PathLike]) -> Rig:
    return rig if isinstance(rig, Rig) else Rig(rig)


def as_pictures(rig: Rig, images: Any, argument: str = "images") -> _core.Pictures:
    """By camera name, or a list with one picture (or None) per camera, in the rig's order."""
    if images is None:
        return _core.Pictures({}, argument)
    if not isinstance(images, Mapping):
        names = rig.cameras
        if not isinstance(images, (list, tuple)):
            raise InputError(
                argument, "", type(images).__name__,
                "must be a dict of pictures by camera name, or a list of them",
            )
        if len(images) != len(names):
            raise InputError(
                argument, "length", str(len(images)), f"must be {len(names)}, the rig's cameras"
            )
        images = dict(zip(names, images))
    for name in images:
        if not isinstance(name, str):
            raise InputError(argument, "camera", repr(name), "must be the name of a camera")
    for name, image in images.items():
        if np.ma.is_masked(image):
            raise InputError(
                argument, name, f"{np.ma.count_masked(image)} masked pixels",
                "must have none: no pixel can be left out; image.filled(0) makes them black",
            )
    return _core.Pictures(
        {name: _in_own_byte_order(image) for name, image in images.items() if image is not None},
        argument,
    )


def _in_own_byte_order(image: Any) -> Any:
    """TIFF and PNG readers give numbers in the order of the file."""
    if isinstance(image, np.ndarray) and not image.dtype.isnative:
        return image.astype(image.dtype.newbyteorder("="))
    return image


def read_rig(path: PathLike) -> Rig:
    """Reads rig.json. InputError names file, field, value and rule of what is wrong in it."""
    return Rig._of(_core.read_rig(path_of(path)))


def ring(
    cameras: int = 6,
    projectors: int = 6,
    *,
    distance_mm: float = 1100,
    volume_radius_mm: float = 170,
    arc_deg: float = 360,
    camera_elevation_deg: float = 15,
    vertical_elevation_deg: float = 8,
    horizontal_elevation_deg: float = 34,
    camera_size: tuple[int, int] = (1280, 960),
    camera_focal_px: float = 2300,
    projector_size: tuple[int, int] = (1280, 1024),
    projector_focal_px: float = 2430,
    pitch_px: float = 12,
    line_width_px: float = 4,
    offset_px: float = 6,
    order: int = 3,
    colors: tuple = (("blue", "cyan"), ("red", "yellow")),
) -> Rig:
    """A ring of cameras and projectors in turn that look at the origin, world z up.

    Parameters
    ----------
    cameras, projectors
        How many, 1 to 256.
    distance_mm
        Of every device to the origin.
    volume_radius_mm
        Radius of the sphere that holds the object.
    arc_deg
        How much of the circle is used.
    camera_elevation_deg, vertical_elevation_deg, horizontal_elevation_deg
        Of cameras, projectors of vertical lines and projectors of horizontal lines.
    camera_size, projector_size
        (width, height), px.
    camera_focal_px, projector_focal_px
        Focal lengths, px.
    pitch_px, line_width_px, offset_px
        Distance of neighbouring lines, width of a line, centre of the first one: projector px.
    order
        Lines in a row whose colours tell where they are.
    colors
        Of the projectors in turn.
    """
    def require(holds: bool, field: str, value: object, rule: str) -> None:
        if not holds:
            raise InputError("ring", field, str(value), rule)

    check_whole("ring", "cameras", cameras, 1, 256)
    check_whole("ring", "projectors", projectors, 1, 256)
    require(volume_radius_mm > 0, "volume_radius_mm", volume_radius_mm, "must be > 0")
    require(distance_mm > volume_radius_mm, "distance_mm", distance_mm,
            "must be larger than volume_radius_mm")
    require(0 < arc_deg <= 360, "arc_deg", arc_deg, "must be in (0, 360]")
    require(pitch_px > 0, "pitch_px", pitch_px, "must be > 0")
    require(0 < line_width_px <= pitch_px, "line_width_px", line_width_px,
            "must be in (0, pitch_px]")
    require(len(colors) > 0 and all(not isinstance(of_one, str) and len(of_one) > 0 for of_one in colors),
            "colors", colors, "must be one or more lists of at least one colour")
    longest = max(len(entry) for entry in colors)
    require(isinstance(order, (int, np.integer)) and 1 <= order <= 20 and longest**order <= 2**20,
            "order", order, "must be a whole number, 1 to 20, and colours^order <= 2^20")
    options = _core.RingOptions()
    options.cameras = cameras
    options.projectors = projectors
    options.distance_mm = distance_mm
    options.volume_radius_mm = volume_radius_mm
    degree = math.pi / 180  # the program's way to round
    options.arc_rad = min(arc_deg * degree, 2 * math.pi)
    options.camera_elevation_rad = camera_elevation_deg * degree
    options.vertical_elevation_rad = vertical_elevation_deg * degree
    options.horizontal_elevation_rad = horizontal_elevation_deg * degree
    options.camera_width, options.camera_height = camera_size
    options.camera_focal_px = camera_focal_px
    options.projector_width, options.projector_height = projector_size
    options.projector_focal_px = projector_focal_px
    options.pitch_px = pitch_px
    options.line_width_px = line_width_px
    options.offset_px = offset_px
    options.order = order
    options.colors = [
        [entry if isinstance(entry, str) else list(entry) for entry in of_one] for of_one in colors
    ]
    # Once through the text, which checks every number as it checks those of a file.
    return Rig._of(_core.Rig(_core.make_ring(options).text(), "ring"))
