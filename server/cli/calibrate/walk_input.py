"""The walks that cameras saw, from files of tracks, or from videos that are tracked first."""

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
from server.service.calibration.calibration_report import RecordedWalk, comparison_step
from server.system.errors import UserError
from tracking.motchallenge import MotRow, read_rows

ENDINGS = (".txt", ".txt.gz")
_FPS = 25.0
_SAME_RATE = 0.01
"""Share by which the rates that files tell of may differ; they are rounded, and a walk is short."""


@dataclass(frozen=True, slots=True)
class VideoFormat:
    """Size and frame rate of the videos, as far as the options give them."""

    size: Size | None
    fps: float | None


def read_walks(
    given: Sequence[Path], config: Path | None, picture: VideoFormat, progress: Callable[[str], None]
) -> RecordedWalk:
    """Read tracks, or track people in videos; ``progress`` is called with the current video.

    Raises:
        UserError: some are tracks and some videos, or as the two functions below.
    """
    tracks = [path for path in given if _is_tracks(path)]
    if tracks and len(tracks) < len(given):
        other = next(path for path in given if path not in tracks)
        raise UserError(f"calibrate: {tracks[0]} is tracks and {other} is not; give one or the other for all")
    return (
        walks_from_tracks(given, picture) if tracks else walks_from_videos(given, config, picture, progress)
    )


def _is_tracks(path: Path) -> bool:
    """Return whether this is a file of tracks, or a folder of such files (or with a folder `tracks/`)."""
    return path.name.endswith(ENDINGS) or (path.is_dir() and bool(_files(path)))


def walks_from_tracks(given: Sequence[Path], picture: VideoFormat) -> RecordedWalk:
    """Read files of tracks, MOTChallenge text; each camera is called like its file.

    Raises:
        UserError: a file cannot be read or has no people in it, or two have one name.
    """
    files = [file for path in given for file in (_files(path) if path.is_dir() else [path])]
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
    """Track people in each video first, as `myview track` does; the configuration's offsets are left out.

    Raises:
        UserError: a video cannot be opened or shows no people, two have one name, or their rates differ.
    """
    names = [camera_name(video) for video in videos]
    _check_names(names)
    # Everything is checked before the first is tracked, which takes a while.
    seen = [read_video_info(video) for video in videos]
    loaded = [config_for_video(video, None, config) for video in videos]
    # Tracks are counted by the site's rate, which is a video's own where the configuration has none.
    rates = {name: one.site.fps for name, one, it in zip(names, loaded, seen, strict=True) if it.fps}
    fps = picture.fps or _rate(rates)
    offsets = [it.cameras[0].offset for it in loaded]
    walks = []
    with TemporaryDirectory() as folder:
        for name, video, it, offset in zip(names, videos, seen, offsets, strict=True):
            progress(name)
            out = Path(folder) / f"{name}.txt"
            track_one(video, None, out, config, None, lambda _: None)
            # With an offset tracks count pulses, and not the video's own frames.
            walks.append(_walk(name, it.size, _rows(out, str(video)), fps, offset))
    return RecordedWalk(tuple(walks), fps)


def _rate(rates: Mapping[str, float]) -> float:
    """Return the rate that all cameras have: frame n of all is one moment."""
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
    return build_walk(name, size, frames, [row.id for row in rows], boxes, comparison_step(fps))


def _rows(path: Path, name: str | None = None) -> list[MotRow]:
    try:
        rows = [row for row in read_rows(path) if row.confidence != 0.0]
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise UserError(str(error)) from error
    if not rows:
        raise UserError(f"{name or path}: nobody is in it")
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
