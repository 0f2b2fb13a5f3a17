"""Calibrates from a recorded walk, and reports the result as text, configuration lines and a ground file."""

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


@dataclass(frozen=True, slots=True)
class RecordedWalk:
    """One walk as each camera saw it.

    Attributes:
        walks: by camera.
        fps: frames a second.
        size_guessed: cameras whose picture size is estimated from the boxes.
        rate_guessed: whether ``fps`` is a default, not measured.
        offsets: by camera, the offset that its frame numbers include already.
        without_offset: cameras that cannot have an offset.
    """

    walks: tuple[Walk, ...]
    fps: float
    size_guessed: tuple[str, ...] = ()
    rate_guessed: bool = False
    offsets: Mapping[str, int] = field(default_factory=dict)
    without_offset: tuple[str, ...] = ()


def ground_file_text(
    unit: str, homographies: Mapping[str, Floats], more: Mapping[str, Any] | None = None
) -> str:
    """Return the text of the ground file: by camera, the homography, (3, 3)."""
    matrices = {camera: matrix.tolist() for camera, matrix in homographies.items()}
    content = {"unit": unit, "homography": matrices, **(more or {})}
    return json.dumps(content, indent=1) + "\n"


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationReport:
    """The result of a calibration, for people and for files.

    Attributes:
        calibration: the calibration.
        lines: the report: errors, coverage, offsets, and where else to walk.
        insufficient: what the walk did not cover, if the result is a guess because of that; else empty.
        offsets: configuration lines that synchronize the cameras; empty: they are synchronized.
        ground: the text of the ground file.
    """

    calibration: WalkCalibration
    lines: tuple[str, ...]
    insufficient: str
    offsets: str
    ground: str


def calibrate_walk(recorded: RecordedWalk, settings: WalkSettings, person_height: float) -> CalibrationReport:
    """Calibrate the cameras on a common floor, in meters; `person_height` is that of the walking person.

    Raises:
        CalibrationError: the walk is insufficient.
    """
    calibration = calibrate_from_walks(recorded.walks, settings, person_height)
    missing = [
        line
        for camera in calibration.cameras
        for line in coverage_gaps(camera.camera, camera.thirds, camera.depth_ratio)
    ]
    homographies = {camera.camera: camera.homography for camera in calibration.cameras}
    return CalibrationReport(
        calibration,
        (*report_lines(recorded, calibration, settings), *(gap.text for gap in missing)),
        next((gap.text for gap in missing if gap.serious), ""),
        offset_lines(recorded, calibration) if settings.maximum_offset else "",
        ground_file_text("m", homographies, details(recorded, calibration, person_height)),
    )


_THIRDS = ("left", "middle", "right")
_MIN_SHARE = 0.03
"""Share of a walk's foot points below which a third of the picture is not covered."""
_SIGNIFICANT = 2.0
"""An offset counts if it is more standard errors than this away from 0."""
_DOUBTFUL_S = 0.15
"""Offsets below this may be errors of foot points: in it people walk a tenth of their height."""
_MIN_DEPTH_RATIO = 1.25
"""How many times as tall the nearest person must appear as the farthest."""


@dataclass(frozen=True, slots=True)
class CoverageGap:
    """Something that the walk did not cover; ``serious`` if the calibration is a guess without it."""

    text: str
    serious: bool


def coverage_gaps(camera: str, thirds: Sequence[float], depth_ratio: float) -> Iterator[CoverageGap]:
    """Yield what the walk did not cover; `thirds` and `depth_ratio` are those of a `CameraCalibration`."""
    uncovered = [name for name, share in zip(_THIRDS, thirds, strict=True) if share < _MIN_SHARE]
    if uncovered:
        where = " and the ".join(uncovered)
        yield CoverageGap(
            f"walk also through the {where} third of camera {camera}, if there is floor and another "
            "camera sees it",
            serious=len(uncovered) > 1,
        )
    if depth_ratio < _MIN_DEPTH_RATIO:
        yield CoverageGap(f"walk also nearer to camera {camera}, and farther from it", serious=True)


def report_lines(recorded: RecordedWalk, calibration: WalkCalibration, settings: WalkSettings) -> list[str]:
    """Return the lines about errors, coverage and offsets."""
    on_floor, in_pictures = _heights(calibration.floor_error), _shares(calibration.image_error)
    lines = [f"feet that two cameras see are {on_floor} apart, in the pictures {in_pictures} of the diagonal"]
    for camera in calibration.cameras:
        left, middle, right = (f"{100 * share:.0f}" for share in camera.thirds)
        lines.append(
            f"{camera.camera}: {_heights(camera.floor_error)}, {_shares(camera.image_error)}; "
            f"of the walk {left} % in the left, {middle} % in the middle and {right} % in the right third, "
            f"the nearest {camera.depth_ratio:.1f} times as tall as the farthest"
        )
    lines += [f"{camera.camera}: left out: {camera.reason}" for camera in calibration.uncalibrated]
    lines += _floors(calibration)
    if recorded.size_guessed:
        sizes = ", ".join(f"{walk.camera} {walk.size[0]}x{walk.size[1]}" for walk in recorded.walks)
        lines.append(f"picture sizes are estimated from the boxes ({sizes}); set them with --size")
    if recorded.rate_guessed:
        lines.append(f"{recorded.fps:g} frames a second are assumed; set the rate with --fps")
    if settings.maximum_offset:
        lines += _offsets(recorded, calibration)
    return lines


def details(recorded: RecordedWalk, calibration: WalkCalibration, person_height: float) -> dict[str, Any]:
    """Return the content of the ground file besides the homographies."""
    return {
        "person": person_height,
        "offset": {camera.camera: _offset(recorded, camera) for camera in calibration.cameras},
        "floor": {camera.camera: camera.floor for camera in calibration.cameras},
        "residuals": {
            camera.camera: {"heights": _numbers(camera.floor_error), "picture": _numbers(camera.image_error)}
            for camera in calibration.cameras
        },
        "left_out": {camera.camera: camera.reason for camera in calibration.uncalibrated},
    }


def _floors(calibration: WalkCalibration) -> list[str]:
    floors = sorted({camera.floor for camera in calibration.cameras})
    if len(floors) == 1:
        return []
    groups = (
        ", ".join(camera.camera for camera in calibration.cameras if camera.floor == floor)
        for floor in floors
    )
    text = f"there are {len(floors)} floors: {'; '.join(groups)}; no camera sees two of them"
    return [f"{text}; they are placed far apart in the file, and offsets hold within each"]


def _offsets(recorded: RecordedWalk, calibration: WalkCalibration) -> list[str]:
    """Return the report about the cameras' time offsets."""
    first, fps = calibration.cameras[0].camera, recorded.fps
    lines = []
    for camera in calibration.cameras:
        if camera.offset or camera.offset_error:
            verdict = "out of sync" if _is_out_of_sync(camera) else "in sync, within the error"
            if _is_out_of_sync(camera) and abs(camera.offset) / fps < _DOUBTFUL_S:
                verdict = "perhaps out of sync; late foot points look alike: compare two frames first"
            if _is_out_of_sync(camera) and camera.camera in recorded.without_offset:
                verdict += "; a live camera has no configurable offset"
            seconds, margin = camera.offset / fps, _SIGNIFICANT * camera.offset_error / fps
            lines.append(f"{camera.camera}: {seconds:+.3f} s later than {first}, ± {margin:.3f} s: {verdict}")
    return lines


def offset_lines(recorded: RecordedWalk, calibration: WalkCalibration) -> str:
    """Return configuration lines that synchronize the cameras; empty if they are synchronized."""
    moved = [
        camera
        for camera in calibration.cameras
        if _is_out_of_sync(camera) and camera.camera not in recorded.without_offset
    ]
    lines = [f"  - id: {camera.camera}\n    offset_s: {_use(recorded, camera):g}\n" for camera in moved]
    return "".join(["cameras:\n", *lines]) if lines else ""


def _offset(recorded: RecordedWalk, camera: CameraCalibration) -> dict[str, float]:
    return {
        "seconds": round(camera.offset / recorded.fps, 4),
        "error": round(camera.offset_error / recorded.fps, 4),
        "use": _use(recorded, camera),
    }


def _use(recorded: RecordedWalk, camera: CameraCalibration) -> float:
    """Return the offset to configure, in seconds: the configured one plus the measured one."""
    frames = recorded.offsets.get(camera.camera, 0) + (round(camera.offset) if _is_out_of_sync(camera) else 0)
    return round(frames / recorded.fps, 4)


def _is_out_of_sync(camera: CameraCalibration) -> bool:
    return abs(camera.offset) > _SIGNIFICANT * camera.offset_error and round(camera.offset) != 0


def _heights(spread: ErrorSummary) -> str:
    return f"{spread.median:.2f} person heights (median; 90 % below {spread.ninth_decile:.2f})"


def _shares(spread: ErrorSummary) -> str:
    return f"{100 * spread.median:.1f} % (90 % below {100 * spread.ninth_decile:.1f} %)"


def _numbers(spread: ErrorSummary) -> dict[str, float]:
    return {"median": round(spread.median, 4), "p90": round(spread.ninth_decile, 4)}
