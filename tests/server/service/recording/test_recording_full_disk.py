"""Old recordings are deleted from a full disk, too, and no file on it is forgotten."""

from __future__ import annotations

from pathlib import Path

import pytest

from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, FedService, small_config
from fakes.service.scripted_recordings import (
    PULSE0,
    UNLIMITED,
    A,
    ManualClocks,
    filled_buffers,
    gop_record,
    pictures,
    session_info,
)
from fakes.system.full_disk import files_of_at_most
from server.service.recording.recording_folder import RecordingFolder
from server.service.recording.recording_session import RecordingSession
from server.service.recording.retention import RetentionLimits
from server.service.recording.segment_index import IndexEntry
from server.service.recording.session_files import InitSegments

BOUNDS = RetentionLimits(keep_s=3.0, max_mb=1e6, segment_s=1.0)
SEGMENT = 25  # pulses


@pytest.fixture
def clock() -> ManualClocks:
    return ManualClocks()


def record(store: RecordingFolder, clock: ManualClocks, gops: range) -> None:
    """Write GOPs of person 1 in a camera, in real time."""
    for gop in gops:
        clock.now = PULSE0 + gop * GOP / FPS
        store.write(gop_record(gop, {1: A}), session_info(), InitSegments(filled_buffers()[1]))


def opened(folder: Path, clock: ManualClocks, bounds: RetentionLimits = BOUNDS) -> RecordingFolder:
    store = RecordingFolder(folder, bounds, clock.machine)
    store.open()
    return store


def close(store: RecordingFolder) -> None:
    """Close a recording folder as a service does at its end."""
    store.close()


def write_on_full_disk(store: RecordingFolder, clock: ManualClocks, gop: int) -> None:
    """Try to write a GOP on a full disk; abandon it as the writer does."""
    with files_of_at_most(0), pytest.raises(OSError, match="large"):
        record(store, clock, range(gop, gop + 1))
    store.abandon_segment()


def on_disk(folder: Path) -> list[int]:
    """Return the first pulses of the segments whose pictures are on the disk."""
    return sorted({int(path.stem) for path in folder.glob("*/cameras/*/*.mp4")})


def files_in(session: RecordingSession) -> set[int]:
    """Return the files that the playlists in memory refer to."""
    indexes = [camera.index for camera in (*session.cameras.values(), *session.objects.values())]
    return {stretch.file for tape in indexes for stretch in tape.all}


def files_in_playlists(session: RecordingSession) -> set[int]:
    """Return the files that the playlists on the disk refer to."""
    files: set[int] = set()
    for path in session.folder.rglob("*.m3u8"):
        files |= {int(line[-16:-4]) for line in path.read_text().splitlines() if line[:1] not in ("#", "")}
    return files


def test_old_recordings_are_deleted_from_a_full_disk(tmp_path: Path, clock: ManualClocks) -> None:
    store = opened(tmp_path, clock)
    record(store, clock, range(20))
    assert on_disk(tmp_path) == [0, 25, 50, 75]
    write_on_full_disk(store, clock, 27)
    session = store.session
    assert session is not None
    assert on_disk(tmp_path) == [50, 75], "earlier ones have expired"
    assert [segment.first for segment in session.segments if segment.bytes] == [50, 75]
    assert files_in(session) == {50, 75}
    assert files_in_playlists(session) == {0, 25, 50, 75}, "the playlists could not be written"
    record(store, clock, range(29, 30))
    assert files_in_playlists(session) == {50, 75, 145}
    played = [pulse for pulse, _ in pictures(session.objects[1].path)]
    assert played == [*range(50, 100), *range(145, 150)]
    store.close()


def test_a_disk_that_is_full_at_the_start_is_locked_and_cleared(tmp_path: Path, clock: ManualClocks) -> None:
    store = opened(tmp_path, clock)
    record(store, clock, range(20))
    close(store)
    clock.now += 2.6
    with files_of_at_most(0):
        restarted = opened(tmp_path, clock)
    assert on_disk(tmp_path) == [75]
    (earlier,) = restarted.earlier
    assert [segment.first for segment in earlier.segments] == [75]
    assert files_in(earlier) == {75}
    restarted.close()


def test_old_recordings_are_deleted_before_a_session_begins(tmp_path: Path, clock: ManualClocks) -> None:
    store = opened(tmp_path, clock)
    record(store, clock, range(20))
    close(store)
    restarted = opened(tmp_path, clock)
    assert on_disk(tmp_path) == [0, 25, 50, 75]
    write_on_full_disk(restarted, clock, 27)
    assert on_disk(tmp_path) == [50, 75]
    assert restarted.session is None, "the session could not begin"
    restarted.close()


def test_playlist_entries_without_files_are_dropped_at_a_restart(tmp_path: Path, clock: ManualClocks) -> None:
    store = opened(tmp_path, clock)
    record(store, clock, range(20))
    write_on_full_disk(store, clock, 27)
    assert store.session is not None
    with files_of_at_most(0):
        close(store)
    assert files_in_playlists(store.session) == {0, 25, 50, 75}
    restarted = opened(tmp_path, clock, UNLIMITED)
    (earlier,) = restarted.earlier
    assert files_in(earlier) == {50, 75} == files_in_playlists(earlier)
    restarted.close()


def test_files_that_cannot_be_deleted_are_not_forgotten(
    tmp_path: Path,
    clock: ManualClocks,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    store = opened(tmp_path, clock)
    record(store, clock, range(20))
    session, real = store.session, Path.unlink
    assert session is not None

    def unlink(path: Path, *, missing_ok: bool = False) -> None:
        if path == session.paths.camera_file(A, 0):
            raise PermissionError(1, "Operation not permitted", str(path))
        real(path, missing_ok=missing_ok)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", unlink)
        record(store, clock, range(27, 28))
    assert on_disk(tmp_path) == [0, 50, 75, 135], "but it is recorded"
    assert [segment.first for segment in session.segments] == [0, 50, 75, 135]
    assert files_in(session) == {50, 75, 135}, "its pictures are no longer played"
    assert f"{session.paths.camera_file(A, 0)}: Operation not permitted" in caplog.text
    record(store, clock, range(33, 34))
    assert on_disk(tmp_path) == [75, 135, 165]
    store.close()


def test_a_full_disk_does_not_stop_the_service_from_starting(tmp_path: Path, clock: ManualClocks) -> None:
    folder = tmp_path / "kept"
    store = opened(folder, clock)
    record(store, clock, range(20))
    close(store)
    service = FedService(small_config(record={"folder": str(folder), "keep_s": 1.5}))
    service.connect_cameras(*CAMERAS)
    with files_of_at_most(0):
        service.recorder.open()
        assert on_disk(folder) == [50, 75]
        service.close()


def test_a_playlist_that_could_not_be_written_stays_stale(tmp_path: Path, clock: ManualClocks) -> None:
    store = opened(tmp_path, clock)
    record(store, clock, range(12))
    assert store.session is not None
    playlist = store.session.cameras[A]
    playlist.drop_segments({0})
    with files_of_at_most(0), pytest.raises(OSError, match="large"):
        playlist.rewrite()
    assert playlist.is_stale
    playlist.append(IndexEntry(A, 50, 9_999, 10, 100, 5))
    assert playlist.is_stale, "new entries follow the dropped ones"
    playlist.rewrite()
    assert not playlist.is_stale
    store.close()
