"""Surfaces: a mesh, with what was measured of it."""

from __future__ import annotations

import os
from typing import Any, Optional, Union

import numpy as np

from . import _core
from ._errors import InputError
from ._rig import PathLike, path_of

MeshLike = Union["Mesh", PathLike, tuple, Any]


class Mesh:
    """A triangle mesh. Its arrays are views of the library's memory, to read.

    Attributes
    ----------
    vertices : (n, 3) float64
        World, mm.
    faces : (m, 3) int32
        Indices of vertices, counter-clockwise seen from outside.
    sigma : (n,) float32, or None
        One standard deviation along the normal, mm.
    confidence : (n,) float32, or None
        0 to 1; 0 where nobody measured.
    color : (n, 3) float32, or None
        Albedo in linear light: red, green, blue in [0, 1].
    hole : (n,) uint8, or None
        Why nobody measured the vertex; 0 where it was measured.
    unit_known : bool
        False: of a rig of unknown unit; lengths are its numbers, and files that are written say so.

    Other programs take the arrays as they are: `trimesh.Trimesh(mesh.vertices, mesh.faces)`,
    `open3d.utility.Vector3dVector(mesh.vertices)`.
    """

    unit_known: bool = True

    def __init__(self, vertices: Any, faces: Any) -> None:
        """From arrays of the shapes (n, 3), mm, and (m, 3); they are copied."""
        self._core = _core.Mesh(np.asarray(vertices, dtype=np.float64), _whole(faces))

    @classmethod
    def _of(cls, core: Any, unit_known: bool = True) -> Optional["Mesh"]:
        if core is None:
            return None
        mesh = cls.__new__(cls)
        mesh._core = core
        mesh.unit_known = unit_known
        return mesh

    @property
    def vertices(self) -> np.ndarray:
        return self._core.vertices

    @property
    def faces(self) -> np.ndarray:
        return self._core.faces

    @property
    def sigma(self) -> Optional[np.ndarray]:
        return self._core.sigma

    @property
    def confidence(self) -> Optional[np.ndarray]:
        return self._core.confidence

    @property
    def color(self) -> Optional[np.ndarray]:
        return self._core.color

    @property
    def hole(self) -> Optional[np.ndarray]:
        return self._core.hole

    @property
    def normals(self) -> np.ndarray:
        """(n, 3) float64: unit normals of the vertices, outward; computed when asked for."""
        return self._core.normals()

    @property
    def area_mm2(self) -> float:
        return self._core.area_mm2

    @property
    def volume_mm3(self) -> float:
        """Above 0 for a closed mesh with outward faces."""
        return self._core.volume_mm3

    def write(self, path: PathLike) -> None:
        """Writes .ply (all there is), .obj, .stl (mm) or .glb (metres, y up).

        Where the unit is unknown, the numbers are those of the mesh in all of them, and the file
        says so.
        """
        self._core.write(path_of(path), self.unit_known)

    def __repr__(self) -> str:
        return f"<pencilscan.Mesh: {len(self.vertices)} vertices, {len(self.faces)} faces>"


def _whole(faces: Any) -> np.ndarray:
    faces = np.asarray(faces)
    if faces.size and not np.issubdtype(faces.dtype, np.integer):
        raise InputError("mesh", "faces", str(faces.dtype), "must be whole numbers")
    if faces.size and not 0 <= faces.min() <= faces.max() <= np.iinfo(np.int32).max:
        raise InputError("mesh", "faces", f"{faces.min()} to {faces.max()}", "must be indices of vertices")
    return faces.astype(np.int32) if faces.size else np.empty((0, 3), np.int32)


def read_mesh(path: PathLike) -> Mesh:
    """Reads PLY (with sigma, confidence, hole and colour), OBJ, STL or OFF, in mm.

    `unit_known` is False where the file says so.
    """
    name = path_of(path)
    return Mesh._of(_core.read_mesh(name), _core.mesh_unit_known(name))


def make_sphere(radius_mm: float, rings: int = 32) -> Mesh:
    """A closed sphere around the origin: `rings` bands (3 to 2048) of twice as many sectors."""
    if not 0 < radius_mm < np.inf:
        raise InputError("make_sphere", "radius_mm", str(radius_mm), "must be > 0 and finite")
    # Chosen: 2048 rings are 17 million faces, and take 0.4 GB.
    if not 3 <= rings <= 2048:
        raise InputError("make_sphere", "rings", str(rings), "must be 3 to 2048")
    return Mesh._of(_core.make_sphere(radius_mm, rings))


def as_mesh(mesh: MeshLike) -> Mesh:
    if isinstance(mesh, Mesh):
        return mesh
    if isinstance(mesh, (str, bytes, os.PathLike)):
        return read_mesh(mesh)
    if isinstance(mesh, tuple) and len(mesh) == 2:
        return Mesh(*mesh)
    faces = getattr(mesh, "faces", getattr(mesh, "triangles", None))
    if hasattr(mesh, "vertices") and faces is not None:
        return Mesh(np.asarray(mesh.vertices), np.asarray(faces))
    raise InputError(
        "mesh", "", type(mesh).__name__,
        "must be a Mesh, a path, (vertices, faces), or have .vertices and .faces",
    )
