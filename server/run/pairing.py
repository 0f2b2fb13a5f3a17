"""Which file of tracks belongs to which file of ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from server.wire.errors import UserError

_ENDINGS = (".txt", ".txt.gz")


@dataclass(frozen=True, slots=True)
class Pair:
    """The two files of one camera."""

    camera: str
    tracks: Path
    truth: Path


def pair_up(tracks: Path, truth: Path) -> list[Pair]:
    """Give the pairs of two files, or of the files of equal names in two folders, by name.

    A folder may be one that `myview render` has written, whose tracks are in `tracks/`, or one with a
    folder `gt/`. Cameras that only one of the two has are left out.

    Raises:
        UserError: one of the two is missing, one is a file and the other a folder, or no names agree.
    """
    for path in (tracks, truth):
        if not path.exists():
            raise UserError(f"{path}: is not there")
    if tracks.is_file() and truth.is_file():
        return [Pair(_camera(tracks), tracks, truth)]
    if tracks.is_file() or truth.is_file():
        raise UserError(f"{tracks} and {truth}: name two files, or two folders")
    found, there = _files(tracks, "tracks"), _files(truth, "gt")
    common = sorted(found.keys() & there.keys())
    if not common:
        raise UserError(
            f"{tracks} and {truth}: no file of the one is called like one of the other "
            f"({_some(found)} here, {_some(there)} there)"
        )
    return [Pair(camera, found[camera], there[camera]) for camera in common]


def _files(folder: Path, inner: str) -> dict[str, Path]:
    """Give the MOTChallenge files of a folder by camera."""
    within = folder / inner if (folder / inner).is_dir() else folder
    files = sorted(path for path in within.iterdir() if path.name.endswith(_ENDINGS))
    if not files:
        raise UserError(f"{within}: has no .txt or .txt.gz files")
    return {_camera(path): path for path in files}


def _camera(path: Path) -> str:
    return path.name.removesuffix(".gz").removesuffix(".txt")


def _some(files: dict[str, Path]) -> str:
    """Name a few."""
    names = [path.name for path in files.values()]
    return ", ".join(names[:3]) + (", …" if len(names) > 3 else "")  # noqa: PLR2004 — enough to recognise
