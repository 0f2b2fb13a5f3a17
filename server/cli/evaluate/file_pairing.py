"""Which file of tracks belongs to which file of ground truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from server.system.address_redaction import redact_address
from server.system.errors import UserError

_ENDINGS = (".txt", ".txt.gz")
_FEW = 3
"""Names in a message: enough to recognise what they are the names of."""


@dataclass(frozen=True, slots=True)
class FilePair:
    """The two files of one camera."""

    camera: str
    tracks: Path
    truth: Path


@dataclass(frozen=True, slots=True)
class _OptionFiles:
    """The files that an option names."""

    option: str
    files: tuple[Path, ...]
    folder: bool
    """Some of the files are from a named folder."""

    @property
    def names(self) -> list[str]:
        return [_camera(path) for path in self.files]

    @property
    def some_names(self) -> str:
        """The first names, for a message."""
        some = [path.name for path in self.files[:_FEW]]
        return ", ".join(some) + (", …" if len(self.files) > _FEW else "")


def pair_files(tracks: Sequence[Path], truth: Sequence[Path]) -> list[FilePair]:
    """Return the pairs, by the files' names where any agree, else in the order in which they are named.

    Each of the two is some files, or a folder of one file per camera: the folder may be one that `myview
    render` has written, whose tracks are in `tracks/`, or one with a folder `gt/`. Of folders, cameras that
    only one of the two has are skipped; a named file must have a partner. A pair is named after its tracks,
    or after its truth where tracks of several cameras have one name.

    Raises:
        UserError: a file is missing, there are no pairs, or a file has no partner.
    """
    tracked, labeled = _given("--tracks", tracks, "tracks"), _given("--gt", truth, "gt")
    if set(tracked.names) & set(labeled.names) or tracked.folder or labeled.folder:
        return _by_name(tracked, labeled)
    if len(tracked.files) != len(labeled.files):
        raise UserError(
            f"--tracks and --gt: {len(tracked.files)} files of tracks ({tracked.some_names}) for "
            f"{len(labeled.files)} of ground truth ({labeled.some_names}), and no two with one name; "
            "give one for each, in the same order"
        )
    names = next((it for it in (tracked.names, labeled.names) if len(set(it)) == len(it)), None)
    if names is None:
        raise UserError(
            f"--tracks and --gt: cannot tell the cameras apart: several files of each are called "
            f"{tracked.some_names} and {labeled.some_names}"
        )
    return [FilePair(*pair) for pair in zip(names, tracked.files, labeled.files, strict=True)]


def files_by_camera(option: str, paths: Sequence[Path], inner: str) -> dict[str, Path]:
    """Return the files that an option names, or those of the folder that it names, by camera.

    Raises:
        UserError: a file is missing, or two files have one name.
    """
    given = _given(option, paths, inner)
    _check_names(given)
    return dict(zip(given.names, given.files, strict=True))


def _by_name(tracked: _OptionFiles, labeled: _OptionFiles) -> list[FilePair]:
    for given in (tracked, labeled):
        _check_names(given)
    tracks, truth = (dict(zip(it.names, it.files, strict=True)) for it in (tracked, labeled))
    common = [camera for camera in tracks if camera in truth]
    if not common:
        raise UserError(
            f"--tracks and --gt: no file of the one is called like one of the other "
            f"({tracked.some_names} here, {labeled.some_names} there)"
        )
    for given, other in ((tracked, truth), (labeled, tracks)):
        alone = [path for path in given.files if _camera(path) not in other]
        if alone and not given.folder:
            missing = "is no ground truth" if given is tracked else "are no tracks"
            raise UserError(f"{given.option}: {alone[0]}: there {missing} of that name beside it")
    return [FilePair(camera, tracks[camera], truth[camera]) for camera in common]


def _given(option: str, paths: Sequence[Path], inner: str) -> _OptionFiles:
    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise UserError(f"{redact_address(str(path))}: is not there")
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
