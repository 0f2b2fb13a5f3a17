"""Files about people are private to the user, regardless of the umask."""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from fakes.service.decisions import choice, decision
from fakes.service.scripted_cameras import CAMERAS, GOP, HEIGHT, SMALL, WIDTH, FedService, small_config
from fakes.service.scripted_recordings import (
    UNLIMITED,
    A,
    filled_buffers,
    gop_record,
    session_info,
    written_folder,
)
from fakes.system.unprivileged import unprivileged_folder
from server.cli.doctor.disk import disk_findings
from server.cli.doctor.findings import Level
from server.media.letterbox import Letterbox
from server.service.decision_files.decision_writer import DecisionWriter
from server.service.decision_files.live_decision_writer import LiveDecisionWriter
from server.service.recording.recording_folder import RecordingFolder
from server.service.recording.session_files import InitSegments
from server.system.private_files import make_private_folder

FITS = dict.fromkeys(CAMERAS, Letterbox((WIDTH, HEIGHT), (WIDTH, HEIGHT)))


@contextlib.contextmanager
def umask(mask: int) -> Iterator[None]:
    before = os.umask(mask)
    try:
        yield
    finally:
        os.umask(before)


@contextlib.contextmanager
def folder_of(user: str, tmp_path: Path) -> Iterator[Path]:
    """Yield a world-readable folder of the current or of an unprivileged user."""
    with contextlib.nullcontext(tmp_path) if user == "current user" else unprivileged_folder() as folder:
        folder.chmod(0o755)
        yield folder


def modes(folder: Path) -> dict[bool, set[int]]:
    """Return the modes of all folders (True) and files (False) below one."""
    found: dict[bool, set[int]] = {True: set(), False: set()}
    for path in folder.rglob("*"):
        found[path.is_dir()].add(stat.S_IMODE(path.stat().st_mode))
    return found


@pytest.mark.parametrize("user", ["current user", "unprivileged"])
@pytest.mark.parametrize("mask", [0o000, 0o022, 0o077])
def test_recordings_are_private(tmp_path: Path, user: str, mask: int) -> None:
    with folder_of(user, tmp_path) as around, umask(mask):
        store = written_folder(
            RecordingFolder(around / "site" / "kept", UNLIMITED),
            [gop_record(gop, {1: A}) for gop in range(7)],
        )
        assert modes(around) == {True: {0o700}, False: {0o600}}
        assert store.session is not None
        store.session.set_person_numbers_since(5.0)
        store.close()
        assert modes(around) == {True: {0o700}, False: {0o600}}


@pytest.mark.parametrize("user", ["current user", "unprivileged"])
@pytest.mark.parametrize("mask", [0o000, 0o022])
def test_decision_files_of_a_live_service_are_private(tmp_path: Path, user: str, mask: int) -> None:
    with folder_of(user, tmp_path) as around, umask(mask):
        recorder = LiveDecisionWriter(around / "out" / "today", CAMERAS, FITS)
        recorder.write_or_skip(decision(0, choice(1, A), c0=[[(1, *SMALL)]] * GOP))
        recorder.close()
        assert modes(around) == {True: {0o700}, False: {0o600}}


def test_renderings_follow_the_umask(tmp_path: Path) -> None:
    with umask(0o022):
        DecisionWriter(tmp_path / "out", CAMERAS, FITS).close()
    assert modes(tmp_path) == {True: {0o755}, False: {0o644}}


def test_an_existing_folder_is_unchanged_and_reported(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "kept"
    folder.mkdir()
    folder.chmod(0o755)
    config = small_config(record={"folder": str(folder)})
    service = FedService(config)
    service.recorder.open()
    service.close()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o755
    (warning,) = [message for message in caplog.messages if message.startswith("record.folder")]
    assert "has mode 755" in warning
    assert "chmod 700" in warning
    (found, *_) = disk_findings(config, {})
    expected = f"{folder} can be written, but has mode 755: others on this machine may see"
    assert (found.level, found.text) == (Level.WARNING, f"{expected} when it was recorded, not what")
    folder.chmod(0o700)
    (found, *_) = disk_findings(config, {})
    assert (found.level, found.text) == (Level.OK, f"{folder} can be written")


def test_own_runs_of_earlier_versions_become_private(tmp_path: Path) -> None:
    written_folder(RecordingFolder(tmp_path, UNLIMITED), [gop_record(0, {1: A})]).close()
    (run,) = (path for path in tmp_path.iterdir() if path.is_dir())
    run.chmod(0o755)
    other = tmp_path / "holiday"
    other.mkdir()
    other.chmod(0o755)
    reopened = RecordingFolder(tmp_path, UNLIMITED)
    reopened.open()
    reopened.write(gop_record(1, {1: A}), session_info(), InitSegments(filled_buffers()[1]))
    reopened.close()
    assert stat.S_IMODE(run.stat().st_mode) == 0o700
    assert stat.S_IMODE(other.stat().st_mode) == 0o755


def test_a_private_folder_is_created_with_its_parents(tmp_path: Path) -> None:
    make_private_folder(tmp_path / "a" / "b" / "c")
    make_private_folder(tmp_path / "a" / "b" / "c")
    (tmp_path / "a" / "file").write_text("")
    with pytest.raises(FileExistsError):
        make_private_folder(tmp_path / "a" / "file")
    with pytest.raises(NotADirectoryError):
        make_private_folder(tmp_path / "a" / "file" / "d")
