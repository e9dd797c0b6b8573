"""What was measured in the pictures: points, curves and crossings as arrays by name."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Table:
    """Arrays of one length by name, as attributes too."""

    # int32 in the files: views of uint32, copies (to read) of uint16.
    _int32: tuple = ()

    def __init__(self, arrays: dict) -> None:
        self._arrays = dict(arrays)
        for name in self._int32:
            array = self._arrays[name]
            array = array.view(np.int32) if array.itemsize == 4 else array.astype(np.int32)
            array.setflags(write=False)
            self._arrays[name] = array

    def __getattr__(self, name: str) -> np.ndarray:
        if name.startswith("_"):  # copies ask for some before there are arrays
            raise AttributeError(f"no property {name}")
        if name not in self._arrays:
            raise AttributeError(f"no property {name}; there are {', '.join(self.names)}")
        return self._arrays[name]

    def __getitem__(self, name: str) -> np.ndarray:
        return self._arrays[name]

    @property
    def names(self) -> list[str]:
        return list(self._arrays)

    def __dir__(self):
        return [*super().__dir__(), *self._arrays]

    def __len__(self) -> int:
        return len(next(iter(self._arrays.values())))

    def __repr__(self) -> str:
        return f"<pencilscan.{type(self).__name__}: {len(self)} of {', '.join(self.names)}>"


class Points(Table):
    """Measured curve pixels: one array per property of points.ply, views of one memory.

    Attributes
    ----------
    xyz : (n, 3) float32
        World, mm; also as x, y, z.
    uv : (n, 2) float32
        Camera pixel; also as u, v.
    camera, projector, pattern : (n,) uint8
        Places in `rig.cameras`, `rig.projectors`, and in the projector's patterns.
    line : (n,) int32
        Which line of the pattern.
    sigma : (n,) float32
        mm, one standard deviation along the camera ray.
    confidence : (n,) float32
        0 to 1.
    plane : (n,) float32
        The line coordinate that was triangulated.
    normal : (n, 3) float32
        Outward unit normal of the surface, 0 where it is not known; also as nx, ny, nz.
    color : (n, 3) uint8
        Colour of the surface as a screen shows it (sRGB), 0 where it is not known; also as red,
        green, blue.
    """

    xyz: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    uv: np.ndarray
    u: np.ndarray
    v: np.ndarray
    camera: np.ndarray
    projector: np.ndarray
    pattern: np.ndarray
    line: np.ndarray
    sigma: np.ndarray
    confidence: np.ndarray
    plane: np.ndarray
    normal: np.ndarray
    nx: np.ndarray
    ny: np.ndarray
    nz: np.ndarray
    color: np.ndarray
    red: np.ndarray
    green: np.ndarray
    blue: np.ndarray

    _int32 = ("line",)


class Curves(Table):
    """Points of all detected curves, one array per property of curves.ply.

    Attributes
    ----------
    xyz, rgb : (n, 3) float32, uint8
        For viewers: the camera's picture before the object, world, mm, and the colour of the labelled
        line; also as x, y, z, red, green, blue.
    uv : (n, 2) float32
        Camera pixel, sub-pixel; also as u, v.
    sigma_px, amplitude : (n,) float32
        One standard deviation across the curve, px; height of the line above its surroundings.
    camera, curve : (n,) uint8, int32
        Which camera; which curve of it. Points of a curve follow each other.
    family, color, color_lead : (n,) uint8, uint8, float32
        Set of colours, likeliest colour in it, log-likelihood by which it leads.
    state : (n,) uint8
        0 labelled, 1 nothing crosses it, 2 ambiguous, 3 contradicted, 4 outside the volume,
        5 undecided.
    projector, pattern, line, confidence : (n,) uint8, uint8, int32, float32
        The label where state is 0.
    """

    xyz: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    uv: np.ndarray
    u: np.ndarray
    v: np.ndarray
    sigma_px: np.ndarray
    amplitude: np.ndarray
    camera: np.ndarray
    curve: np.ndarray
    family: np.ndarray
    color: np.ndarray
    color_lead: np.ndarray
    state: np.ndarray
    projector: np.ndarray
    pattern: np.ndarray
    line: np.ndarray
    confidence: np.ndarray
    rgb: np.ndarray
    red: np.ndarray
    green: np.ndarray
    blue: np.ndarray

    _int32 = ("curve", "line")


class Crossings(Table):
    """Where two curves of a camera cross: uv (n, 2) float32, camera uint8, curve_a, curve_b int32."""

    uv: np.ndarray
    u: np.ndarray
    v: np.ndarray
    camera: np.ndarray
    curve_a: np.ndarray
    curve_b: np.ndarray

    _int32 = ("curve_a", "curve_b")


class CameraDepth(NamedTuple):
    """Depth of one camera at its full resolution; NaN where there is none."""

    z: np.ndarray
    """(height, width) float32: camera z, mm."""
    sigma: np.ndarray
    """(height, width) float32: one standard deviation of z, mm."""
