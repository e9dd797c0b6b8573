"""A rig from Gray-code captures, and what its calibration says of it."""

from __future__ import annotations

import json
import os
import re
from typing import Any, Optional, Sequence, Union

from . import _core
from ._errors import InputError, StageError
from ._rig import PathLike, Progress, Rig, check_range, check_threads, finished, path_of, rig_text


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
    check_threads(threads)
    check_range("max_tracks", max_tracks, 2**63 - 1)
    check_range("seed", seed, 2**64 - 1)
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
