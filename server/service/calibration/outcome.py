"""From what the cameras saw of a walk to all that is said and written of it."""

from __future__ import annotations

from dataclasses import dataclass

from bestview.calibration import WalkCalibration, WalkSettings, calibrate_walks
from server.service.calibration.ground_file import ground_file
from server.service.calibration.report_text import details, in_words, missed, offset_lines
from server.service.calibration.walk_comparison import Walked


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a walk has shown.

    Attributes:
        found: the calibration.
        lines: the same in words: errors, coverage, offsets, and where to walk, too.
        too_little: what the walk did not cover, where it is a guess for want of that; else empty.
        offsets: lines of a configuration that bring the cameras into step; empty: they are.
        ground: the text of the ground file.
    """

    found: WalkCalibration
    lines: tuple[str, ...]
    too_little: str
    offsets: str
    ground: str


def worked_out(walked: Walked, settings: WalkSettings, person: float) -> Outcome:
    """Lay the cameras on one floor, in metres where people are `person` metres tall.

    Raises:
        CalibrationError: the walk says too little.
    """
    found = calibrate_walks(walked.walks, settings, person)
    missing = [line for it in found.cameras for line in missed(it.camera, it.thirds, it.deep)]
    homographies = {it.camera: it.homography for it in found.cameras}
    return Outcome(
        found,
        (*in_words(walked, found, settings), *(it.words for it in missing)),
        next((it.words for it in missing if it.serious), ""),
        offset_lines(walked, found) if settings.shift else "",
        ground_file("m", homographies, details(walked, found, person)),
    )
