"""Entire shapes from one frame of a ring of cameras and projectors.

    import pencilscan as ps

    rig = ps.read_rig("rig.json")                     # or ps.ring(), ps.calibrate(...)
    result = ps.reconstruct(rig, {"cam0": image0, "cam1": image1})
    result.points.xyz                                 # (n, 3) float32, mm
    result.mesh.vertices, result.mesh.faces           # the closed surface

Lengths are mm, images RGB with pixel centres at whole numbers, world z is up. Arrays that the
library gives are views of its memory. `help(ps.reconstruct)` tells all options.
"""

from . import _core
from ._calibration import CalibratedRig, calibrate
from ._errors import Cancelled, InputError, StageError
from ._mesh import Mesh, make_sphere, read_mesh
from ._rig import Rig, read_rig, ring
from ._scan import Result, SimulatedFrame, evaluate, reconstruct, simulate
from ._stages import Detection, GridCurves, Labels, detect, label, measure
from ._tables import CameraDepth, Crossings, Curves, Points

__version__: str = _core.version
__all__ = [
    "CalibratedRig",
    "CameraDepth",
    "Cancelled",
    "Crossings",
    "Curves",
    "Detection",
    "GridCurves",
    "InputError",
    "Labels",
    "Mesh",
    "Points",
    "Result",
    "Rig",
    "SimulatedFrame",
    "StageError",
    "calibrate",
    "detect",
    "evaluate",
    "label",
    "make_sphere",
    "measure",
    "read_mesh",
    "read_rig",
    "reconstruct",
    "ring",
    "simulate",
]
