"""Walks for the calibration, from files of tracks, or from videos, which are tracked first."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bestview.calibration import Walk, build_walk
from server.cli.generated_config import camera_name
from server.cli.render.video_info import Size, read_video_info
from server.cli.track.command import config_for_video, track_one
from server.service.calibration.calibration_report import RecordedWalk
from server.system.errors import UserError, reason_of
from tracking.motchallenge import MotRow, read_rows

ENDINGS = (".txt", ".txt.gz")
_FPS = 25.0
_SAME_RATE = 0.01
"""Relative difference allowed between the frame rates of files: they are rounded, and a walk is short."""


@dataclass(frozen=True, slots=True)
class VideoFormat:
    """Size and frame rate of all inputs, as the options give them; None: not given."""

    size: Size | None
    fps: float | None


def read_walks(
    inputs: Sequence[Path], config: Path | None, picture: VideoFormat, progress: Callable[[str], None]
) -> RecordedWalk:
    """Read tracks, or track people in videos; ``progress`` is called with the current camera.

    Raises:
        UserError: some inputs are tracks and some videos, or as :func:`walks_from_tracks` and
            :func:`walks_from_videos`.
    """
    tracks = [path for path in inputs if _is_tracks(path)]
    if tracks and len(tracks) < len(inputs):
        other = next(path for path in inputs if path not in tracks)
        raise UserError(
            f"calibrate: {tracks[0]} is tracks and {other} is not; give only tracks, or only videos"
        )
    return (
        walks_from_tracks(inputs, picture) if tracks else walks_from_videos(inputs, config, picture, progress)
    )


def _is_tracks(path: Path) -> bool:
    """Return whether a path is a file of tracks, or a folder with such files or a folder `tracks/`."""
    return path.name.endswith(ENDINGS) or (path.is_dir() and bool(_files(path)))


def walks_from_tracks(inputs: Sequence[Path], picture: VideoFormat) -> RecordedWalk:
    """Read files of tracks (MOTChallenge); each camera is named after its file.

    Raises:
        UserError: a file cannot be read or has no people, or two have the same name.
    """
    files = [file for path in inputs for file in (_files(path) if path.is_dir() else [path])]
    names = [camera_name(Path(file.name.removesuffix(".gz"))) for file in files]
    _check_names(names)
    rows = {file: _rows(file) for file in files}
    fps = picture.fps or _FPS
    walks, guessed = [], []
    for name, file in zip(names, files, strict=True):
        size = picture.size or _size_of(rows[file])
        guessed += [name] if picture.size is None else []
        walks.append(_walk(name, size, rows[file], fps))
    return RecordedWalk(tuple(walks), fps, tuple(guessed), rate_guessed=picture.fps is None)


def walks_from_videos(
    videos: Sequence[Path], config: Path | None, picture: VideoFormat, progress: Callable[[str], None]
) -> RecordedWalk:
    """Track people in each video, as `myview track` does, without the configured offsets.

    Raises:
        UserError: a video cannot be opened or shows no people, two have the same name, or rates differ.
    """
    names = [camera_name(video) for video in videos]
    _check_names(names)
    # All videos are checked before the first is tracked, which takes a while.
    infos = [read_video_info(video) for video in videos]
    loaded = [config_for_video(video, None, config) for video in videos]
    # Frames are counted at the site's rate, by default that of the video.
    rates = {
        name: config.site.fps for name, config, info in zip(names, loaded, infos, strict=True) if info.fps
    }
    fps = picture.fps or _rate(rates)
    offsets = [config.cameras[0].first_pulse(config.site.fps) for config in loaded]
    walks = []
    with TemporaryDirectory() as folder:
        for name, video, info, offset in zip(names, videos, infos, offsets, strict=True):
            progress(name)
            out = Path(folder) / f"{name}.txt"
            track_one(video, None, out, config, None, lambda _: None)
            # With an offset, tracks count pulses instead of the video's frames.
            walks.append(_walk(name, info.size, _rows(out, str(video)), fps, offset))
    return RecordedWalk(tuple(walks), fps)


def _rate(rates: Mapping[str, float]) -> float:
    """Return the common frame rate: frame n of all cameras is the same moment."""
    first = next(iter(rates), None)
    if first is None:
        return _FPS
    for name, fps in rates.items():
        if abs(fps / rates[first] - 1.0) > _SAME_RATE:
            raise UserError(
                f"calibrate: {name} has {fps:g} frames a second and {first} {rates[first]:g}: "
                "convert them to one rate, or set --fps"
            )
    return rates[first]


def _walk(name: str, size: Size, rows: Sequence[MotRow], fps: float, offset: int = 0) -> Walk:
    boxes = np.array([row.box for row in rows], dtype=np.float64).reshape(-1, 4)
    # Files count frames from 1, pulses from 0.
    frames = [row.frame - 1 - offset for row in rows]
    return build_walk(name, size, frames, [row.id for row in rows], boxes, fps)


def _rows(path: Path, name: str | None = None) -> list[MotRow]:
    try:
        rows = [row for row in read_rows(path) if row.confidence != 0.0]
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {reason_of(error)}") from error
    except ValueError as error:
        raise UserError(str(error)) from error
    if not rows:
        raise UserError(f"{name or path}: has no people")
    if any(row.id < 0 for row in rows):
        raise UserError(
            f"{path}: has detections, not tracks (id -1); `myview track --det` makes tracks of them"
        )
    return rows


def _files(folder: Path) -> list[Path]:
    within = folder / "tracks" if (folder / "tracks").is_dir() else folder
    return sorted(path for path in within.iterdir() if path.name.endswith(ENDINGS))


def _size_of(rows: Sequence[MotRow]) -> Size:
    right = max(row.box[2] for row in rows)
    bottom = max(row.box[3] for row in rows)
    return math.ceil(right) + 1, math.ceil(bottom) + 1


def _check_names(names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise UserError(f"calibrate: two cameras are called {name!r}; file names must be unique")
