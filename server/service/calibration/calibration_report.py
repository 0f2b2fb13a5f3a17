"""From what the cameras saw of a walk to all that is said and written of it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from bestview.calibration import (
    CameraCalibration,
    ErrorSummary,
    Floats,
    Walk,
    WalkCalibration,
    WalkSettings,
    calibrate_from_walks,
)

_MOMENT_S = 0.2
"""Seconds between the moments at which cameras are compared: people walk a sixth of their height."""


@dataclass(frozen=True, slots=True)
class RecordedWalk:
    """The cameras' walks, and how many frames there are in a second.

    `guessed` are cameras whose picture's size is only guessed, from the boxes; `rate_guessed` is whether the
    rate is only what is usual. `offsets` are by camera those that the frames have in them already; of those
    that are `live` none can be set.
    """

    walks: tuple[Walk, ...]
    fps: float
    guessed: tuple[str, ...] = ()
    rate_guessed: bool = False
    offsets: Mapping[str, int] = field(default_factory=dict)
    live: tuple[str, ...] = ()


def walk_settings(fps: float, shift: float) -> WalkSettings:
    """Return the settings for cameras that are out of sync by at most `shift` seconds."""
    return WalkSettings(maximum_offset=round(shift * fps), step=comparison_step(fps))


def comparison_step(fps: float) -> int:
    """Return the frames between the moments at which cameras are compared."""
    return max(1, round(_MOMENT_S * fps))


def ground_file_text(
    unit: str, homographies: Mapping[str, Floats], more: Mapping[str, Any] | None = None
) -> str:
    """Return the text of the ground file: by camera, the homography, (3, 3)."""
    matrices = {camera: matrix.tolist() for camera, matrix in homographies.items()}
    content = {"unit": unit, "homography": matrices, **(more or {})}
    return json.dumps(content, indent=1) + "\n"


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationReport:
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


def calibrate_walk(walked: RecordedWalk, settings: WalkSettings, person: float) -> CalibrationReport:
    """Lay the cameras on one floor, in metres where people are `person` metres tall.

    Raises:
        CalibrationError: the walk says too little.
    """
    found = calibrate_from_walks(walked.walks, settings, person)
    missing = [line for it in found.cameras for line in coverage_gaps(it.camera, it.thirds, it.depth_ratio)]
    homographies = {it.camera: it.homography for it in found.cameras}
    return CalibrationReport(
        found,
        (*report_lines(walked, found, settings), *(it.words for it in missing)),
        next((it.words for it in missing if it.serious), ""),
        offset_lines(walked, found) if settings.maximum_offset else "",
        ground_file_text("m", homographies, details(walked, found, person)),
    )


_THIRDS = ("left", "middle", "right")
_LITTLE = 0.03
"""Share of a walk below which it has not covered a third of the picture."""
_SURE = 2.0
"""Standard errors that an offset must be away from 0, or else it is none."""
_SHORT_S = 0.15
"""Seconds in which people walk by a tenth of their height, which is how exactly feet are found."""
_SHALLOW = 1.25
"""How many times as tall the nearest must appear as the farthest."""


@dataclass(frozen=True, slots=True)
class CoverageGap:
    """Something that the walk did not cover; serious, where a calibration would be a guess."""

    words: str
    serious: bool


def coverage_gaps(camera: str, thirds: Sequence[float], deep: float) -> Iterator[CoverageGap]:
    """Yield what the walk did not cover; `thirds` and `deep` are as of a `CameraCalibration`."""
    bare = [name for name, share in zip(_THIRDS, thirds, strict=True) if share < _LITTLE]
    if bare:
        where = " and the ".join(bare)
        yield CoverageGap(
            f"walk also through the {where} third of camera {camera}, if there is floor and another "
            "camera sees it",
            serious=len(bare) > 1,
        )
    if deep < _SHALLOW:
        yield CoverageGap(f"walk also nearer to camera {camera}, and farther from it", serious=True)


def report_lines(walked: RecordedWalk, found: WalkCalibration, settings: WalkSettings) -> list[str]:
    """Return the report about errors, coverage and offsets, line by line."""
    on_floor, in_pictures = _heights(found.heights), _shares(found.picture)
    lines = [f"feet that two cameras see are {on_floor} apart, in the pictures {in_pictures} of the diagonal"]
    for it in found.cameras:
        left, middle, right = (f"{100 * share:.0f}" for share in it.thirds)
        lines.append(
            f"{it.camera}: {_heights(it.heights)}, {_shares(it.picture)}; of the walk {left} % in the left, "
            f"{middle} % in the middle and {right} % in the right third, the nearest {it.depth_ratio:.1f} "
            "times as tall as the farthest"
        )
    lines += [f"{it.camera}: left out: {it.reason}" for it in found.uncalibrated]
    lines += _floors(found)
    if walked.guessed:
        sizes = ", ".join(f"{it.camera} {it.size[0]}x{it.size[1]}" for it in walked.walks)
        lines.append(f"the pictures' size is guessed from the boxes ({sizes}); --size says it better")
    if walked.rate_guessed:
        lines.append(f"{walked.fps:g} frames a second are taken for granted; --fps says it better")
    if settings.maximum_offset:
        lines += _offsets(walked, found)
    return lines


def details(walked: RecordedWalk, found: WalkCalibration, person: float) -> dict[str, Any]:
    """Return what the ground file holds beside the homographies."""
    return {
        "person": person,
        "offset": {it.camera: _offset(walked, it) for it in found.cameras},
        "floor": {it.camera: it.floor for it in found.cameras},
        "residuals": {
            it.camera: {"heights": _numbers(it.heights), "picture": _numbers(it.picture)}
            for it in found.cameras
        },
        "left_out": {it.camera: it.reason for it in found.uncalibrated},
    }


def _floors(found: WalkCalibration) -> list[str]:
    floors = sorted({it.floor for it in found.cameras})
    if len(floors) == 1:
        return []
    groups = (", ".join(it.camera for it in found.cameras if it.floor == floor) for floor in floors)
    said = f"there are {len(floors)} floors: {'; '.join(groups)}; no camera sees two of them"
    return [f"{said}; they lie far apart in the file, and offsets hold within each"]


def _offsets(walked: RecordedWalk, found: WalkCalibration) -> list[str]:
    """Return the report about the cameras' time offsets."""
    first, fps = found.cameras[0].camera, walked.fps
    lines = []
    for it in found.cameras:
        if it.offset or it.offset_error:
            how = "out of step" if _moved(it) else "in step, as far as can be told"
            if _moved(it) and abs(it.offset) / fps < _SHORT_S:
                how = "perhaps out of step; feet that are found late look so, too: compare two frames first"
            if _moved(it) and it.camera in walked.live:
                how += "; its pictures come when they come: nothing can be set for that"
            frames = f"{it.offset:+.1f} frames ({it.offset / fps:+.2f} s)"
            unsure = f"give or take {_SURE * it.offset_error:.1f}"
            lines.append(f"{it.camera}: {frames} later than {first}, {unsure}: {how}")
    return lines


def offset_lines(walked: RecordedWalk, found: WalkCalibration) -> str:
    """Return configuration lines that synchronize the cameras; empty if they are synchronized."""
    moved = [it for it in found.cameras if _moved(it) and it.camera not in walked.live]
    lines = [f"  - id: {it.camera}\n    offset: {_use(walked, it)}\n" for it in moved]
    return "".join(["cameras:\n", *lines]) if lines else ""


def _offset(walked: RecordedWalk, camera: CameraCalibration) -> dict[str, float]:
    return {
        "frames": round(camera.offset, 2),
        "error": round(camera.offset_error, 2),
        "use": _use(walked, camera),
    }


def _use(walked: RecordedWalk, camera: CameraCalibration) -> int:
    """Return the offset to configure: the configured one plus the measured one."""
    return walked.offsets.get(camera.camera, 0) + (round(camera.offset) if _moved(camera) else 0)


def _moved(camera: CameraCalibration) -> bool:
    return abs(camera.offset) > _SURE * camera.offset_error and round(camera.offset) != 0


def _heights(spread: ErrorSummary) -> str:
    return f"{spread.median:.2f} person heights (median; 90 % below {spread.ninth_decile:.2f})"


def _shares(spread: ErrorSummary) -> str:
    return f"{100 * spread.median:.1f} % (90 % below {100 * spread.ninth_decile:.1f} %)"


def _numbers(spread: ErrorSummary) -> dict[str, float]:
    return {"median": round(spread.median, 4), "p90": round(spread.ninth_decile, 4)}
