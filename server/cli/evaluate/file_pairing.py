"""Pairing of track files with ground truth files, by name or order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from server.system.address_redaction import redact_to_host
from server.system.errors import UserError

_ENDINGS = (".txt", ".txt.gz")
_MAX_NAMES = 3
"""File names in an error."""


@dataclass(frozen=True, slots=True)
class FilePair:
    """The two files of one camera."""

    camera: str
    tracks: Path
    truth: Path


@dataclass(frozen=True, slots=True)
class _OptionFiles:
    """The files of an option."""

    option: str
    files: tuple[Path, ...]
    folder: bool
    """Whether some of the files are from a folder."""

    @property
    def names(self) -> list[str]:
        return [_camera(path) for path in self.files]

    @property
    def some_names(self) -> str:
        """The first names, for a message."""
        some = [path.name for path in self.files[:_MAX_NAMES]]
        return ", ".join(some) + (", …" if len(self.files) > _MAX_NAMES else "")


def pair_files(tracks: Sequence[Path], truth: Sequence[Path]) -> list[FilePair]:
    """Pair files of tracks and ground truth, by name if any names agree, otherwise in the given order.

    Each option gives files, or a folder with one file per camera: it may have been written by `myview
    render`, with tracks in `tracks/`, or have a folder `gt/`. In folders, cameras without a partner are
    skipped; a file must have a partner. A pair is named after its tracks, or after its truth if tracks of
    several cameras have the same name.

    Raises:
        UserError: a file is missing, there are no pairs, or a file has no partner.
    """
    tracked, labeled = _option_files("--tracks", tracks, "tracks"), _option_files("--gt", truth, "gt")
    if set(tracked.names) & set(labeled.names) or tracked.folder or labeled.folder:
        return _by_name(tracked, labeled)
    if len(tracked.files) != len(labeled.files):
        raise UserError(
            f"--tracks and --gt: {len(tracked.files)} files of tracks ({tracked.some_names}) for "
            f"{len(labeled.files)} of ground truth ({labeled.some_names}), and none with equal names; "
            "give one for each, in the same order"
        )
    candidates = (tracked.names, labeled.names)
    names = next((names for names in candidates if len(set(names)) == len(names)), None)
    if names is None:
        raise UserError(
            f"--tracks and --gt: the cameras cannot be distinguished: several files of each are called "
            f"{tracked.some_names} and {labeled.some_names}"
        )
    return [FilePair(*pair) for pair in zip(names, tracked.files, labeled.files, strict=True)]


def files_by_camera(option: str, paths: Sequence[Path], inner: str) -> dict[str, Path]:
    """Return the files of an option, or of its folder, by camera.

    Raises:
        UserError: a file is missing, or two files have the same name.
    """
    given = _option_files(option, paths, inner)
    _check_names(given)
    return dict(zip(given.names, given.files, strict=True))


def _by_name(tracked: _OptionFiles, labeled: _OptionFiles) -> list[FilePair]:
    for given in (tracked, labeled):
        _check_names(given)
    tracks, truth = (dict(zip(side.names, side.files, strict=True)) for side in (tracked, labeled))
    common = [camera for camera in tracks if camera in truth]
    if not common:
        raise UserError(
            f"--tracks and --gt: no file names agree ({tracked.some_names} here, {labeled.some_names} there)"
        )
    for given, other in ((tracked, truth), (labeled, tracks)):
        alone = [path for path in given.files if _camera(path) not in other]
        if alone and not given.folder:
            missing = "is no ground truth" if given is tracked else "are no tracks"
            raise UserError(f"{given.option}: {alone[0]}: there {missing} of that name beside it")
    return [FilePair(camera, tracks[camera], truth[camera]) for camera in common]


def _option_files(option: str, paths: Sequence[Path], inner: str) -> _OptionFiles:
    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise UserError(f"{redact_to_host(str(path))}: does not exist")
        files += _files(path, inner) if path.is_dir() else [path]
    return _OptionFiles(option, tuple(files), any(path.is_dir() for path in paths))


def _check_names(given: _OptionFiles) -> None:
    seen: dict[str, Path] = {}
    for path, camera in zip(given.files, given.names, strict=True):
        if camera in seen:
            raise UserError(f"{given.option}: {seen[camera]} and {path} are both called {camera!r}")
        seen[camera] = path


def _files(folder: Path, inner: str) -> list[Path]:
    """Return the MOTChallenge files of a folder, by name."""
    within = folder / inner if (folder / inner).is_dir() else folder
    files = sorted(path for path in within.iterdir() if path.name.endswith(_ENDINGS))
    if not files:
        raise UserError(f"{within}: has no .txt or .txt.gz files")
    return files


def _camera(path: Path) -> str:
    return path.name.removesuffix(".gz").removesuffix(".txt")
