"""What the cameras saw of a walk: from files of tracks, or from videos that are tracked first."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bestview.calibrate import Walk, WalkSettings, make_walk
from server.camera.sources.opening import open_video
from server.run.setup import camera_name
from server.run.track import track_one
from server.wire.errors import UserError
from server.wire.loading import read_content
from tracking.motchallenge import MotRow, read_rows

ENDINGS = (".txt", ".txt.gz")
_FPS = 25.0
_MOMENT_S = 0.2
"""Seconds between the moments at which cameras are compared: people walk a sixth of their height."""


@dataclass(frozen=True, slots=True)
class Walked:
    """The cameras' walks, and how many frames there are in a second.

    `guessed` are cameras whose picture's size is only guessed, from the boxes.
    """

    walks: tuple[Walk, ...]
    fps: float
    guessed: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Picture:
    """What is known of the pictures: their size and rate, if the user has said so."""

    size: tuple[int, int] | None
    fps: float | None


def walk_settings(fps: float, shift: float) -> WalkSettings:
    """Give the settings for recordings of so many frames a second, out of step by `shift` seconds at most."""
    step = max(1, round(_MOMENT_S * fps))
    return WalkSettings(shift=round(shift * fps), step=step)


def is_tracks(path: Path) -> bool:
    """Tell whether this is a file of tracks, or a folder of such files (or with a folder `tracks/`)."""
    return path.name.endswith(ENDINGS) or (path.is_dir() and bool(_files(path)))


def walks_from_tracks(given: Sequence[Path], picture: Picture) -> Walked:
    """Read files of tracks, MOTChallenge text; each camera is called like its file.

    Raises:
        UserError: a file cannot be read or has nobody in it, or two have one name.
    """
    files = [file for path in given for file in (_files(path) if path.is_dir() else [path])]
    rows = {file: _rows(file) for file in files}
    names = [camera_name(Path(file.name.removesuffix(".gz"))) for file in files]
    _check_names(names)
    walks, guessed = [], []
    for name, file in zip(names, files, strict=True):
        size = picture.size or _size_of(rows[file])
        guessed += [name] if picture.size is None else []
        walks.append(_walk(name, size, rows[file]))
    return Walked(tuple(walks), picture.fps or _FPS, tuple(guessed))


def walks_from_videos(
    videos: Sequence[Path], config: Path | None, picture: Picture, progress: Callable[[str], None]
) -> Walked:
    """Track people in each video first, as `myview track` does; the configuration's offsets are left out.

    Raises:
        UserError: a video cannot be opened, nobody is in it, or two have one name.
    """
    names = [camera_name(video) for video in videos]
    _check_names(names)
    known = _offsets(config) if config else {}
    walks, fps = [], picture.fps
    with TemporaryDirectory() as folder:
        for name, video in zip(names, videos, strict=True):
            progress(name)
            out = Path(folder) / f"{name}.txt"
            track_one(video, None, out, config, None, lambda _: None)
            opened = open_video(str(video))
            opened.container.close()
            fps = fps or opened.fps
            walks.append(_walk(name, opened.size, _rows(out, str(video)), known.get(name, 0)))
    return Walked(tuple(walks), fps or _FPS)


def _offsets(config: Path) -> dict[str, int]:
    """Give the offsets that a configuration's cameras have; with them, tracks count pulses."""
    cameras = read_content(config).get("cameras") or []
    return {str(it["id"]): int(it.get("offset", 0)) for it in cameras if isinstance(it, dict) and "id" in it}


def _walk(name: str, size: tuple[int, int], rows: Sequence[MotRow], offset: int = 0) -> Walk:
    boxes = np.array([row.box for row in rows], dtype=np.float64).reshape(-1, 4)
    # Files count frames from 1, pulses from 0.
    return make_walk(name, size, [row.frame - 1 - offset for row in rows], [row.id for row in rows], boxes)


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


def _size_of(rows: Sequence[MotRow]) -> tuple[int, int]:
    right = max(row.box[2] for row in rows)
    bottom = max(row.box[3] for row in rows)
    return math.ceil(right) + 1, math.ceil(bottom) + 1


def _check_names(names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise UserError(f"calibrate: two cameras are called {name!r}; every file's name must be its own")
