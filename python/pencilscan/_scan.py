"""From pictures to shape, from shape to pictures, and how good the shape is."""

from __future__ import annotations

import json
import os
from typing import Any, Callable, Mapping, Optional, Sequence, Union

import numpy as np

from . import _core
from ._errors import InputError
from ._mesh import Mesh, MeshLike, as_mesh
from ._rig import (
    PathLike, Progress, Rig, as_pictures, as_rig, check_name, check_range, check_threads, finished,
    path_of,
)
from ._tables import CameraDepth, Crossings, Curves, Points


class Result:
    """What one frame gives. All arrays are views of one memory, which lives as long as any of them.

    Attributes
    ----------
    points : Points
        points.ply.
    curves : Curves
        curves.ply.
    crossings : Crossings
        Its crossings.
    mesh : Mesh, or None without mesh=True
        The closed surface, mesh.ply.
    measured : Mesh, or None
        The same without what nobody measured, mesh_measured.ply.
    depth : dict of CameraDepth by camera
        Filled with depth_maps=True.
    report : dict
        report.json: counts, residuals, warnings.
    """

    def __init__(self, core: Any) -> None:
        self._core = core
        self.points = Points(core.points)
        self.curves = Curves(core.curves)
        self.crossings = Crossings(core.crossings)
        self.mesh = Mesh._of(core.mesh, core.unit_known)
        self.measured = Mesh._of(core.measured, core.unit_known)
        self.depth = {name: CameraDepth(*maps) for name, maps in core.depth.items()}
        self.report: dict = json.loads(core.report)

    @property
    def warnings(self) -> list[str]:
        """What to know about this result, in plain words."""
        return self.report["warnings"]

    def write(self, folder: PathLike) -> None:
        """points.ply, curves.ply, report.json, mesh.ply and mesh_measured.ply, as the program.

        report.json lacks `picture` of the cameras: there are no files whose hash it would be.

        Without a mesh, those of an earlier result in the folder are removed.
        """
        self._core.write(path_of(folder))

    def __repr__(self) -> str:
        faces = len(self.mesh.faces) if self.mesh else 0
        return f"<pencilscan.Result: {len(self.points)} points, {faces} faces>"


def reconstruct(
    rig: Union[Rig, dict, PathLike],
    images: Union[Mapping[str, np.ndarray], Sequence[Optional[np.ndarray]]],
    method: Union[str, Callable[..., Any]] = "joint",
    mesh: bool = True,
    progress: Optional[Progress] = None,
    *,
    depth: bool = True,
    depth_maps: bool = False,
    plain: Optional[Mapping[str, np.ndarray]] = None,
    multiview_cost: str = "normalized",
    frame: str = "000000",
    threads: int = 0,
) -> Result:
    """The shape in one frame, with the values of `pencilscan reconstruct`.

    Parameters
    ----------
    rig
        The calibrated devices.
    images
        Array per camera name, or a list in the order of the rig's cameras: (height, width, 3) RGB
        or (height, width); uint8 or uint16, or float32 in [0, 1]; as the camera gave them. Float
        arrays of three channels are used where they lie. OpenCV's BGR becomes RGB by
        `image[..., ::-1]`. Cameras may be absent.
    method
        joint, or the paper's linear and multiview, or single-projector. Or a function of yours, which
        decides the lines: it gets what `detect(..., identities=True)` gives and returns `Labels`;
        guided matching, depth and surface then follow as after joint (`measure`).
    mesh
        False: points and curves alone, much faster.
    progress
        Called as progress(stage, done) with the stage at work and the share of stages that are
        done, in the caller's thread; last as progress("done", 1.0). False ends the call with Cancelled. Ctrl-C works without it.
    depth
        Dense depth between the curves (joint only); else the surface rests on the curves.
    depth_maps
        Keep them in the result; InputError without mesh or depth, of which they come.
    plain
        The same moment in plain light, for the colour of the mesh.
    multiview_cost
        published or normalized.
    frame
        What the report calls it.
    threads
        Of the whole process meanwhile; 0: as it is. Results do not depend on it.

    Raises
    ------
    InputError
        Pictures that do not fit the rig, an unknown method.
    StageError
        No curve could be given its line.
    Cancelled
        `progress` returned False.

    Other Python threads run meanwhile.
    """
    check_threads(threads)
    check_name("frame", frame)
    if callable(method):
        from ._stages import detect_curves, measure

        detection = detect_curves(
            rig, images, identities=True, plain=plain, frame=frame, threads=threads,
            progress=progress,
        )
        return measure(
            detection, method(detection), mesh, progress, depth=depth, depth_maps=depth_maps,
            threads=threads,
        )
    check_name("method", method)
    check_name("multiview_cost", multiview_cost)
    rig = as_rig(rig)
    result = Result(
        _core.reconstruct(
            rig._core, as_pictures(rig, images), as_pictures(rig, plain, "plain"),
            method, multiview_cost, mesh, depth, depth_maps, frame, threads, progress,
        )
    )
    finished(progress)
    return result


class SimulatedFrame(dict):
    """The pictures of one moment by camera name: (height, width, 3) uint8 or uint16, RGB; of a camera
    with a mosaic (height, width).

    `truth` is the mesh where this frame has it.
    """

    truth: Mesh

    @property
    def images(self) -> dict:
        return dict(self)


def simulate(
    rig: Union[Rig, dict, PathLike],
    mesh: MeshLike,
    noise: str = "medium",
    seed: int = 1,
    *,
    fit: bool = False,
    up: str = "z",
    bits: int = 8,
    albedo: float = 0.8,
    smooth: bool = True,
    frame: int = 0,
    rotate_deg: float = 0,
    translate_mm: Sequence[float] = (0, 0, 0),
    threads: int = 0,
    progress: Optional[Progress] = None,
) -> SimulatedFrame:
    """What the cameras of a rig would see of a mesh: the pictures of `pencilscan simulate`.

    Parameters
    ----------
    mesh
        A Mesh, the path of one, (vertices, faces), or anything with .vertices and .faces; mm.
    noise
        Sensor and room: none, low, medium, high.
    seed
        Of the noise.
    fit
        Centre and scale the mesh into the rig's volume.
    up
        Axis of the mesh that points up: x, y, z.
    bits
        8 or 16.
    albedo
        In [0, 1].
    smooth
        Interpolated normals; False: one normal per face (cubes).
    frame, rotate_deg, translate_mm
        Of a moving object: the frame's number, its turn about the vertical and its shift per frame.
    threads, progress
        As in `reconstruct`.
    """
    check_threads(threads)
    check_name("noise", noise)
    check_name("up", up)
    check_range("seed", seed, 2**64 - 1)
    check_range("frame", frame, 2**31 - 1)
    shift = tuple(float(x) for x in translate_mm)
    if len(shift) != 3:
        raise InputError("simulate", "translate_mm", str(shift), "must have three numbers")
    scene = as_rig(rig)
    images, truth = _core.simulate(
        scene._core, as_mesh(mesh)._core, noise, seed, fit, up, bits, albedo, smooth, frame,
        rotate_deg * np.pi / 180, shift, threads, progress,
    )
    simulated = SimulatedFrame(images)
    simulated.truth = Mesh._of(truth, scene._core.unit_known)
    finished(progress)
    return simulated


def evaluate(
    truth: MeshLike,
    rig: Union[Rig, dict, PathLike],
    result: Union[Result, Mesh, PathLike],
    align: str = "none",
    *,
    seed: int = 1,
    threads: int = 0,
    progress: Optional[Progress] = None,
) -> dict:
    """Measures a result against the truth: the figures of `pencilscan evaluate --json`.

    Parameters
    ----------
    truth
        The true mesh, in any of the forms that `simulate` takes.
    rig
        The rig that the result was made with.
    result
        A Result, a mesh, or the path of a frame's output folder, a points.ply or a mesh.
    align
        Move the result onto the truth first: none, rigid, similarity.
    seed
        Of the surface samples.
    threads, progress
        As in `reconstruct`.
    """
    check_threads(threads)
    check_name("align", align)
    core, points, measured = None, b"", None
    if isinstance(result, Result):
        core = result._core
    elif isinstance(result, Mesh):
        measured = result._core
    else:
        points, measured = _result_files(path_of(result))
    check_range("seed", seed, 2**64 - 1)
    text = _core.judge(
        as_mesh(truth)._core, as_rig(rig)._core, core, points, measured, align, seed, threads,
        progress,
    )
    finished(progress)
    return json.loads(text)


def _result_files(path: bytes) -> tuple[bytes, Any]:
    """The points and the mesh of a frame's folder, or of one file."""
    if not os.path.exists(path):
        raise InputError(os.fsdecode(path), "", "", "no such file or folder")
    if not os.path.isdir(path):
        try:
            return b"", _core.read_mesh(path)
        except InputError as error:
            if error.field != "faces":
                raise
            return path, None
    points = os.path.join(path, b"points.ply")
    mesh = os.path.join(path, b"mesh_measured.ply")
    if not os.path.exists(points) and not os.path.exists(mesh):
        raise InputError(os.fsdecode(path), "", "", "must hold points.ply or mesh_measured.ply")
    return (
        points if os.path.exists(points) else b"",
        _core.read_mesh(mesh) if os.path.exists(mesh) else None,
    )
