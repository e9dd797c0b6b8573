"""From pictures to shape, from shape to pictures, and how good the shape is."""

from __future__ import annotations

import json
import os
import re
from typing import Any, Callable, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np

from . import _core
from ._errors import InputError, StageError
from ._rig import (
    PathLike, Rig, as_pictures, as_rig, check_name, check_whole, finished, path_of, rig_text,
)

Progress = Callable[[str, float], Optional[bool]]
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


def _check_range(name: str, value: int, last: int) -> None:
    """InputError unless 0 <= value <= last, before the library says it in terms of its own."""
    check_whole("options", name, value, 0, last)


def _check_threads(threads: int) -> None:
    _check_range("threads", threads, 2**31 - 1)


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


def _as_mesh(mesh: MeshLike) -> Mesh:
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


class _Table:
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


class Points(_Table):
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


class Curves(_Table):
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


class Crossings(_Table):
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
        Keep them in the result.
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
    _check_threads(threads)
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
    _check_threads(threads)
    check_name("noise", noise)
    check_name("up", up)
    _check_range("seed", seed, 2**64 - 1)
    _check_range("frame", frame, 2**31 - 1)
    shift = tuple(float(x) for x in translate_mm)
    if len(shift) != 3:
        raise InputError("simulate", "translate_mm", str(shift), "must have three numbers")
    scene = as_rig(rig)
    images, truth = _core.simulate(
        scene._core, _as_mesh(mesh)._core, noise, seed, fit, up, bits, albedo, smooth, frame,
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
    _check_threads(threads)
    core, points, measured = None, b"", None
    if isinstance(result, Result):
        core = result._core
    elif isinstance(result, Mesh):
        measured = result._core
    else:
        points, measured = _result_files(path_of(result))
    _check_range("seed", seed, 2**64 - 1)
    text = _core.judge(
        _as_mesh(truth)._core, as_rig(rig)._core, core, points, measured, align, seed, threads,
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


class CalibratedRig(Rig):
    """A rig with what its calibration says of it.

    Attributes
    ----------
    verdict : str
        good or doubtful.
    reasons : list of str
        Why it is doubtful, in plain words.
    figures : dict
        What `pencilscan calibrate --json` writes.
    report : dict
        calibration.json.
    """

    verdict: str
    reasons: list[str]
    figures: dict
    report: dict

    @classmethod
    def _with(
        cls, core: Any, verdict: str, reasons: list[str], figures: dict, report: dict
    ) -> "CalibratedRig":
        rig = cls._of(core)
        rig.verdict, rig.reasons = verdict, reasons
        rig.figures, rig.report = figures, report
        return rig

    def __reduce__(self):
        said = (self.verdict, self.reasons, self.figures, self.report)
        return _calibrated, (self._core.text(), *said)


def _argument_names(text: str) -> str:
    """What the program says of its options, of the arguments here: --known-distance, known_distance."""
    return re.sub(r"(?<![\w/-])--([a-z]+(?:-[a-z]+)*)", lambda m: m[1].replace("-", "_"), text)


def _calibrated(text: str, *said: Any) -> CalibratedRig:
    return CalibratedRig._with(_core.Rig(text, "rig"), *said)


def calibrate(
    captures: Union[PathLike, Sequence[PathLike]],
    devices: Union[Rig, dict, PathLike],
    *,
    known_distance: Optional[tuple[str, str, float]] = None,
    board: str = "",
    focal_tolerance: Optional[float] = None,
    center_tolerance: Optional[float] = None,
    max_tracks: int = 0,
    seed: int = 1,
    threads: int = 0,
    progress: Optional[Progress] = None,
) -> CalibratedRig:
    """The rig from Gray-code captures, as `pencilscan calibrate`.

    Parameters
    ----------
    captures
        Folder with <projector>/<camera>/NNN.png, or a list of them: one per pose of the object.
    devices
        A rig.json, or a dictionary like it, in which K, distortion, R and t may be missing.
    known_distance
        ("cam0", "cam1", 850.0): two devices and the distance of their centres, mm. Without it or a
        board the rig has no scale.
    board
        In the captures: "chessboard:9x7:75" or "charuco:10x8:75:56:DICT_5X5_100".
    focal_tolerance, center_tolerance
        How far off given focal lengths may be, one standard deviation in per cent (0: they are exact),
        and given principal points, px; None: the program's default.
    max_tracks
        Surface points to use at most; 0: the program's default.
    seed
        Of everything random.
    threads, progress
        As in `reconstruct`.

    Raises
    ------
    StageError
        The captures determine no usable rig; the report is its attribute `report`.
    """
    _check_threads(threads)
    _check_range("max_tracks", max_tracks, 2**63 - 1)
    _check_range("seed", seed, 2**64 - 1)
    if isinstance(captures, (str, bytes, os.PathLike)):
        captures = [captures]
    path, text = None, ""
    if isinstance(devices, Rig):
        text = devices._core.text()
    elif isinstance(devices, dict):
        text = rig_text(devices)
    else:
        path = path_of(devices)
    try:
        core, verdict, reasons, figures, report = _core.calibrate(
            path, text, [path_of(folder) for folder in captures], known_distance, board,
            focal_tolerance, center_tolerance, max_tracks, seed, threads, progress,
        )
    except InputError as error:
        file = "options" if error.file == "command line" else _argument_names(error.file)
        raise InputError(
            file, _argument_names(error.field), error.value, _argument_names(error.rule)
        ) from None
    reasons = [_argument_names(reason) for reason in reasons]
    if verdict == "unusable":
        error = StageError("unusable: " + "; ".join(reasons))
        error.report = json.loads(report)  # type: ignore[attr-defined]
        raise error
    finished(progress)
    return CalibratedRig._with(core, verdict, reasons, json.loads(figures), json.loads(report))
