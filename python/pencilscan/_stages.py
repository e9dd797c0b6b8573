"""One frame stage by stage: curves and grid, labels, and the rest; the labels may be the caller's."""

from __future__ import annotations

from typing import Any, Mapping, Optional, Sequence, Union

import numpy as np

from . import _core
from ._errors import InputError
from ._rig import PathLike, Progress, Rig, as_pictures, as_rig, check_name, check_threads, finished
from ._scan import Result
from ._tables import Crossings, Curves, Table


class GridCurves(Table):
    """What the grid says of each curve before its line is known; views of one memory.

    Attributes
    ----------
    camera, curve : (n,) uint8, int32
        Which camera; which curve of it.
    component : (n,) int32
        Connected component of the camera's grid graph; -1 where nothing crosses the curve.
    projector, pattern : (n,) int16
        Whose line it is; -1 where that is not decided. With identities only, as the next two.
    local_id : (n,) int32
        Line modulo the period of the pattern's code; -1: not decided.
    id_probability : (n,) float32
        0 to 1.
    """

    camera: np.ndarray
    curve: np.ndarray
    component: np.ndarray
    projector: np.ndarray
    pattern: np.ndarray
    local_id: np.ndarray
    id_probability: np.ndarray

    _int32 = ("curve",)


class Detection:
    """Curves and grid graphs of one frame, without labels. All arrays are views.

    Attributes
    ----------
    curves : Curves
        Every detected curve point; those of a curve follow each other.
    crossings : Crossings
        Where curves cross.
    grid : GridCurves
        One entry per curve, in the order of `curves`.
    curve_of_point : (len(curves),) int64
        Index into `grid` for every curve point.
    """

    def __init__(self, core: Any) -> None:
        self._core = core
        self.curves = Curves(core.curves)
        self.crossings = Crossings(core.crossings)
        self.grid = GridCurves(core.grid)

    @property
    def curve_of_point(self) -> np.ndarray:
        if len(self.curves) == 0:
            return np.empty(0, np.int64)
        camera, curve = self.curves.camera, self.curves.curve
        begins = (np.diff(curve.astype(np.int64)) != 0) | (np.diff(camera.astype(np.int64)) != 0)
        return np.concatenate([[0], np.cumsum(begins)])

    @property
    def rig(self) -> Rig:
        return Rig._of(self._core.rig)

    def __repr__(self) -> str:
        return f"<pencilscan.Detection: {len(self.grid)} curves, {len(self.curves)} points>"


class Labels(Table):
    """Which line each curve point is, in the order of `Detection.curves`.

    Attributes
    ----------
    projector, pattern : (n,) int16
        Places in `rig.projectors` and in its patterns; projector -1 where there is no label.
    line : (n,) int32
        Which line of the pattern.
    confidence : (n,) float32
        0 to 1.
    plane : (n,) float64
        Line coordinate that is triangulated; NaN: that of the line.
    """

    projector: np.ndarray
    pattern: np.ndarray
    line: np.ndarray
    confidence: np.ndarray
    plane: np.ndarray

    def __init__(
        self,
        projector: Any,
        pattern: Any,
        line: Any,
        confidence: Any = 1.0,
        plane: Any = None,
    ) -> None:
        """From arrays of one length, or a number for all; they are copied."""
        sizes = [np.size(v) for v in (projector, pattern, line, confidence, plane) if np.ndim(v)]
        count = sizes[0] if sizes else 1

        def column(values: Any, name: str, whole: bool) -> np.ndarray:
            array = np.asarray(values)
            if array.ndim > 1:
                raise InputError("labels", name, f"shape {array.shape}", "must be (n,)")
            if whole and not np.issubdtype(array.dtype, np.integer):
                raise InputError("labels", name, str(array.dtype), "must be whole numbers")
            if array.dtype.kind not in "iuf":
                raise InputError("labels", name, str(array.dtype), "must be numbers")
            if whole and array.size:  # what does not fit would come out as another number
                first, last = int(array.min()), int(array.max())
                if not -(2**31) <= first <= last < 2**31:
                    raise InputError("labels", name, f"{first} to {last}", "must be in [-2^31, 2^31)")
            return np.full(count, array) if array.ndim == 0 else array

        self._core = _core.Labels(
            column(projector, "projector", True),
            column(pattern, "pattern", True),
            column(line, "line", True),
            column(confidence, "confidence", False),
            column(np.nan if plane is None else plane, "plane", False),
        )
        super().__init__(self._core.arrays)

    @classmethod
    def _of(cls, core: Any) -> "Labels":
        labels = cls.__new__(cls)
        labels._core = core
        Table.__init__(labels, core.arrays)
        return labels


def detect(
    rig: Union[Rig, dict, PathLike],
    images: Union[Mapping[str, np.ndarray], Sequence[Optional[np.ndarray]]],
    method: str = "joint",
    *,
    identities: bool = False,
    plain: Optional[Mapping[str, np.ndarray]] = None,
    frame: str = "000000",
    threads: int = 0,
    progress: Optional[Progress] = None,
) -> Detection:
    """The first stages of `reconstruct`: curves of every camera and their grid graphs.

    Parameters
    ----------
    rig, images, plain, frame, threads, progress
        As in `reconstruct`.
    method
        Which method the curves are for: linear, multiview and single-projector need identities.
    identities
        Decide projector, pattern and local ID of each curve in any case.
    """
    detection = detect_curves(
        rig, images, method, identities=identities, plain=plain, frame=frame, threads=threads,
        progress=progress,
    )
    finished(progress)
    return detection


def detect_curves(
    rig: Any, images: Any, method: str = "joint", *, identities: bool, plain: Any, frame: str,
    threads: int, progress: Optional[Progress],
) -> Detection:
    """`detect` as a part of more: its end is not the end."""
    check_threads(threads)
    check_name("method", method)
    check_name("frame", frame)
    rig = as_rig(rig)
    return Detection(
        _core.detect(
            rig._core, as_pictures(rig, images), as_pictures(rig, plain, "plain"),
            method, identities, frame, threads, progress,
        )
    )


def label(
    detection: Detection,
    method: str = "joint",
    *,
    multiview_cost: str = "normalized",
    threads: int = 0,
    progress: Optional[Progress] = None,
) -> Labels:
    """The lines that a method gives to the curves, before guided matching completes them.

    Raises
    ------
    InputError
        The method needs identities, and the curves were detected without.
    """
    check_threads(threads)
    check_name("method", method)
    check_name("multiview_cost", multiview_cost)
    labels = Labels._of(
        _core.label(detection._core, method, multiview_cost, threads, progress)
    )
    finished(progress)
    return labels


def measure(
    detection: Detection,
    labels: Labels,
    mesh: bool = True,
    progress: Optional[Progress] = None,
    *,
    guided: bool = True,
    depth: bool = True,
    depth_maps: bool = False,
    threads: int = 0,
) -> Result:
    """The rest of the way: from labels to points, depth and surface.

    Parameters
    ----------
    labels
        One for every point of `detection.curves`, of `label` or of your own.
    guided
        Surfaces may confirm and complete the labels, and dense depth may follow, as after joint.
        False: labels are taken as they are, as after the paper's methods.
    mesh, progress, depth, depth_maps, threads
        As in `reconstruct`.

    Raises
    ------
    InputError
        Labels of another number than curve points, or that name no line of the rig.
    StageError
        No point results.
    """
    if not isinstance(labels, Labels):
        raise InputError("labels", "", type(labels).__name__, "must be pencilscan.Labels")
    check_threads(threads)
    result = Result(
        _core.measure(
            detection._core, labels._core, "joint" if guided else "multiview", mesh, depth,
            depth_maps, threads, progress,
        )
    )
    finished(progress)
    return result
