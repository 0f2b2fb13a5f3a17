"""Recording continues when its folder is lost, and lost recordings are no longer offered."""

from __future__ import annotations

import asyncio
import logging
import shutil
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from fakes.service.fed_site import ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, LARGE, SMALL
from fakes.service.scripted_recordings import (
    UNLIMITED,
    A,
    B,
    filled_buffers,
    gop_record,
    pictures,
    session_info,
)
from fakes.system.full_disk import files_of_at_most
from fakes.system.unprivileged import unprivileged_folder
from server.service.recording.recording_folder import RecordingFolder
from server.service.recording.recording_session import RecordingSession
from server.service.recording.retention import RetentionLimits
from server.service.recording.session_files import InitSegments

NOTHING = "nothing of object 1 is recorded from p0 on; there is nothing"
Harm = Callable[[Path, Path], None]
"""Damage to a folder and the session in it."""


def removed(name: str) -> Harm:
    """Remove something below the folder: ``RUN`` stands for the session's folder."""

    def harm(folder: Path, session: Path) -> None:
        path = Path(str(folder / name).replace("RUN", session.name))
        shutil.rmtree(path) if path.is_dir() else path.unlink()

    return harm


def replaced_by_file(name: str) -> Harm:
    def harm(folder: Path, session: Path) -> None:
        removed(name)(folder, session)
        Path(str(folder / name).replace("RUN", session.name)).write_text("of another program\n")

    return harm


def moved(name: str) -> Harm:
    def harm(folder: Path, session: Path) -> None:
        path = Path(str(folder / name).replace("RUN", session.name))
        path.rename(folder.parent / "elsewhere")

    return harm


def made_empty(name: str) -> Harm:
    """Replace a folder by an empty one, as when its disk is unmounted."""

    def harm(folder: Path, session: Path) -> None:
        removed(name)(folder, session)
        Path(str(folder / name).replace("RUN", session.name)).mkdir()

    return harm


def truncated(name: str) -> Harm:
    def harm(folder: Path, session: Path) -> None:
        Path(str(folder / name).replace("RUN", session.name)).write_bytes(b"")

    return harm


LEVELS = [".", "RUN", "RUN/cameras", "RUN/cameras/c0", "RUN/index", "RUN/objects"]
FILES = [
    "RUN/session.json",
    "RUN/cameras/c0/000000000000.mp4",
    "RUN/index/000000000000.jsonl",
    "RUN/cameras/c0.m3u8",
    "RUN/objects/1.m3u8",
    ".lock",
]


def write_gops(store: RecordingFolder, gops: range) -> None:
    for gop in gops:
        try:
            store.write(gop_record(gop, {1: A, 2: B}), session_info(), InitSegments(filled_buffers()[1]))
        except OSError:
            store.abandon_segment()  # as the writer does


def check_no_orphaned_files(folder: Path) -> None:
    """Check that all files on the disk are known after a restart, so that they will be deleted in time."""
    before = {path for path in folder.rglob("*") if path.is_file()}
    store = RecordingFolder(folder, UNLIMITED)
    store.open()
    store.close()
    assert {path for path in folder.rglob("*") if path.is_file()} == before, "the restart deleted nothing"
    named = {
        file
        for session in store.earlier
        for first in session.segments
        for file in session.paths.segment_files(first.first)
    }
    lists = {
        camera.path
        for session in store.earlier
        for camera in (*session.cameras.values(), *session.objects.values())
    }
    fixed = {
        session.folder / file
        for session in store.earlier
        for file in ("session.json", "cameras/init.mp4", "sound/init.mp4")
    }
    unknown = before - named - lists - fixed - {folder / ".lock", folder / "clock.json"}
    assert {path for path in unknown if path.read_bytes() != b"of another program\n"} == set()


def recorded_pulses(folder: Path) -> list[int]:
    """Return the recorded pulses of camera c0, by playing its files."""
    store = RecordingFolder(folder, UNLIMITED)
    store.open()
    store.close()
    found = [session.cameras[A].path for session in store.earlier if session.cameras[A].path.exists()]
    return [pulse for path in found for pulse, _ in pictures(path)]


@pytest.mark.parametrize(
    "harm",
    [
        *(pytest.param(removed(level), id=f"removed {level}") for level in [*LEVELS, *FILES]),
        *(pytest.param(moved(level), id=f"moved {level}") for level in LEVELS),
        *(pytest.param(made_empty(level), id=f"emptied {level}") for level in LEVELS),
        *(pytest.param(replaced_by_file(level), id=f"a file {level}") for level in LEVELS[1:]),
        *(
            pytest.param(truncated(file), id=f"truncated {file}")
            for file in ["RUN/cameras/c0.m3u8", "RUN/session.json"]
        ),
    ],
)
def test_recording_continues_at_once_and_leaves_no_orphaned_files(tmp_path: Path, harm: Harm) -> None:
    folder = tmp_path / "kept"
    store = RecordingFolder(folder, UNLIMITED)
    store.open()
    write_gops(store, range(3))
    assert store.session is not None
    harm(folder, store.session.folder)
    write_gops(store, range(3, 9))
    store.close()
    assert set(range(3 * GOP, 9 * GOP)) <= set(recorded_pulses(folder)), "later GOPs are complete"
    check_no_orphaned_files(folder)


def test_recording_fails_cleanly_while_a_file_is_in_the_folders_place_and_then_continues(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "kept"
    store = RecordingFolder(folder, UNLIMITED)
    store.open()
    write_gops(store, range(3))
    shutil.rmtree(folder)
    folder.write_text("of another program\n")
    write_gops(store, range(3, 6))
    assert sorted(tmp_path.iterdir()) == [folder]
    folder.unlink()
    write_gops(store, range(6, 9))
    store.close()
    assert recorded_pulses(folder) == list(range(6 * GOP, 9 * GOP))
    check_no_orphaned_files(folder)


def test_a_disk_that_is_mounted_again_is_recorded_to_and_its_sessions_are_known(tmp_path: Path) -> None:
    folder, away = tmp_path / "kept", tmp_path / "unmounted"
    store = RecordingFolder(folder, UNLIMITED)
    store.open()
    write_gops(store, range(3))
    folder.rename(away)
    write_gops(store, range(3, 6))
    assert store.session is not None
    assert store.earlier == []
    shutil.rmtree(folder)
    away.rename(folder)
    write_gops(store, range(6, 9))
    (earlier,) = store.earlier
    assert [(entry.first, entry.end) for entry in earlier.objects[1].index.all] == [(0, 3 * GOP)]
    store.close()
    assert recorded_pulses(folder) == [*range(3 * GOP), *range(6 * GOP, 9 * GOP)]
    check_no_orphaned_files(folder)


def test_a_folder_that_another_process_locked_meanwhile_is_left_to_it(tmp_path: Path) -> None:
    folder = tmp_path / "kept"
    store, other = RecordingFolder(folder, UNLIMITED), RecordingFolder(folder, UNLIMITED)
    store.open()
    write_gops(store, range(3))
    shutil.rmtree(folder)
    other.open()
    write_gops(other, range(3))
    with pytest.raises(BlockingIOError, match="another process records there"):
        store.write(gop_record(3, {1: A}), session_info(), InitSegments(filled_buffers()[1]))
    store.abandon_segment()
    other.close()
    write_gops(store, range(4, 6))
    store.close()
    assert recorded_pulses(folder) == [*range(3 * GOP), *range(4 * GOP, 6 * GOP)]


@pytest.mark.parametrize("closed", [".", "RUN", "RUN/cameras", "RUN/cameras/c0", "RUN/index", "RUN/objects"])
def test_recording_fails_cleanly_without_permission_and_then_continues(closed: str) -> None:
    with unprivileged_folder() as tmp_path:
        folder = tmp_path / "kept"
        store = RecordingFolder(folder, RetentionLimits(1e6, 1e6, 2 * GOP / FPS))
        store.open()
        write_gops(store, range(3))
        assert store.session is not None
        path = Path(str(folder / closed).replace("RUN", store.session.folder.name))
        path.chmod(0o500)
        write_gops(store, range(3, 8))
        path.chmod(0o700)
        write_gops(store, range(8, 10))
        store.close()
        recorded = recorded_pulses(folder)
        assert set(recorded) >= {*range(3 * GOP), *range(8 * GOP, 10 * GOP)}
        if closed != ".":
            assert set(recorded) == set(range(10 * GOP)), "it continued in a new folder"
        check_no_orphaned_files(folder)


def test_old_recordings_that_cannot_be_deleted_do_not_stop_the_recording(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with unprivileged_folder() as tmp_path:
        first = RecordingFolder(tmp_path, UNLIMITED)
        first.open()
        write_gops(first, range(12))
        first.close()
        closed = [path for path in tmp_path.rglob("*") if path.is_dir()]
        for file in closed:
            file.chmod(0o500)
        store = RecordingFolder(tmp_path, RetentionLimits(1e-9, 1e6, 1.0))
        store.open()
        write_gops(store, range(20, 24))
        for file in closed:
            file.chmod(0o700)
        assert store.session is not None
        assert [(entry.first, entry.end) for entry in store.session.cameras[A].index.all] == [(100, 120)]
        logged = [message for message in caplog.messages if "cannot delete expired segments" in message]
        assert len(logged) == 1
        assert "Permission denied" in logged[0]
        store.close()


def test_a_full_disk_leaves_no_files_at_any_try_and_then_recording_continues(tmp_path: Path) -> None:
    store = RecordingFolder(tmp_path, UNLIMITED)
    store.open()
    write_gops(store, range(3))
    before = {path for path in tmp_path.rglob("*") if path.is_file()}
    for size in (0, 100, len(filled_buffers()[1]) + 100):
        with files_of_at_most(size):
            write_gops(store, range(5, 8))
        assert {path for path in tmp_path.rglob("*") if path.is_file()} == before
    write_gops(store, range(8, 10))
    store.close()
    assert recorded_pulses(tmp_path) == [*range(3 * GOP), *range(8 * GOP, 10 * GOP)]
    check_no_orphaned_files(tmp_path)


def test_remains_without_media_are_removed_and_media_without_session_info_are_logged(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    RecordingSession.create(tmp_path / "20260101T000000Z", session_info(), InitSegments(b"x"), 1.0)
    (tmp_path / "20260101T000000Z" / "session.json").unlink()
    media = tmp_path / "20260102T000000Z" / "cameras" / "c0" / "000000000000.mp4"
    foreign = tmp_path / "holiday" / "notes.txt"
    for folder in (media, foreign):
        folder.parent.mkdir(parents=True)
        folder.write_bytes(b"")
    store = RecordingFolder(tmp_path, UNLIMITED)
    store.open()
    store.close()
    assert not (tmp_path / "20260101T000000Z").exists()
    assert media.exists()
    assert foreign.exists()
    assert "20260102T000000Z has no session.json" in caplog.text


def test_a_session_without_decision_files_stays_and_ages(tmp_path: Path) -> None:
    store = RecordingFolder(tmp_path, UNLIMITED)
    store.open()
    write_gops(store, range(12))
    store.close()
    assert store.session is not None
    shutil.rmtree(store.session.folder / "index")
    restarted = RecordingFolder(tmp_path, UNLIMITED)
    restarted.open()
    restarted.close()
    assert [segment.first for segment in restarted.earlier[0].segments] == [0, 25, 50]
    assert set(recorded_pulses(tmp_path)) == set(range(12 * GOP))


def test_starting_a_new_session_folder_is_logged_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    store = RecordingFolder(tmp_path / "kept", UNLIMITED)
    store.open()
    for gop in range(20):
        write_gops(store, range(gop, gop + 1))
        assert store.session is not None
        shutil.rmtree(store.session.folder / "cameras" / "c0")
    store.close()
    lines = [record for record in caplog.records if record.levelno >= logging.WARNING]
    assert len(lines) == 1
    assert lines[0].getMessage().endswith(": No such file or directory; starting a new folder")


@pytest.fixture
async def served(tmp_path: Path) -> AsyncIterator[ServedSite]:
    """Person 1 is in c0 for six GOPs, of which only the last is in memory."""
    async for site in serve_site(record={"folder": str(tmp_path / "kept"), "segment_s": 0.4}):
        await record_gops(site)
        yield site


async def record_gops(served: ServedSite) -> None:
    """Record six GOPs of person 1."""
    served.service.recorder.recent._frames = GOP
    served.service.recorder.open()
    served.service.connect_cameras(*CAMERAS)
    served.service.state_replication.begin(0)
    for epoch in range(7):
        served.service.feed(epoch, {A: {1: LARGE}, B: {1: SMALL}})
    await until(lambda: written(served) == 6)


async def until(condition: Callable[[], bool]) -> None:
    while not condition():  # noqa: ASYNC110 — another thread writes
        await asyncio.sleep(0.001)


def written(served: ServedSite) -> int:
    assert served.service.recorder.writer is not None
    return served.service.recorder.writer.written


async def fetch(served: ServedSite, path: str) -> tuple[int, bytes]:
    async with served.session.get(path) as answer:
        return answer.status, await answer.read()


@pytest.mark.parametrize(
    "harm", [removed("."), removed("RUN"), moved("."), made_empty("RUN"), replaced_by_file("RUN")]
)
async def test_lost_recordings_are_not_offered(served: ServedSite, harm: Harm) -> None:
    store = served.service.recorder.folder
    assert store is not None
    assert store.session is not None
    assert (await fetch(served, "/objects/1/best.mp4?from=p0&to=p10"))[0] == 200
    harm(store.folder, store.session.folder)
    for path in (
        "/objects/1/best.mp4?from=p0&to=p10",
        "/objects/1/best.ts?from=p0&to=p10",
        "/cameras/c0/live.mp4?from=p0&to=p10",
        "/objects/1/hls/index.m3u8?from=p0&to=p10",
        "/cameras/c0/hls/index.m3u8?from=p0&to=p10",
        "/api/past?from=p0&to=p10",
    ):
        status, body = await fetch(served, path)
        assert status == 416, path
        assert b"recorded from" in body
        assert body.count(b"\n") == 0
    for path in ("/api/objects/1/past", "/api/cameras/c0/past"):
        spans = (await served.get_json(path))["spans"]
        assert [span["first"] for span in spans] == [spans[0]["first"]], "only frames in memory"
        assert spans[0]["first"] >= 4 * GOP, path


@pytest.mark.parametrize(
    ("path", "status", "error"),
    [
        ("/api/objects/1/past", 404, "nothing is recorded of object 1"),
        ("/objects/1/best.mp4?from=p0&to=p10", 404, "there is no object 1"),
        ("/objects/1/hls/index.m3u8?from=p0&to=p10", 416, NOTHING),
        ("/objects/1/hls/0.m4s", 404, "no segment 0: expired, or not available yet"),
    ],
)  # fmt: skip
async def test_a_person_known_only_from_lost_recordings_is_unknown(
    served: ServedSite, path: str, status: int, error: str
) -> None:
    store = served.service.recorder.folder
    assert store is not None
    served.service.recorder.recent._choices.clear()
    served.service.splicer.forget([], [])
    served.service.splicer._persons._ended.clear()
    served.service.decider.people.registry.first_seen.clear()
    assert len((await served.get_json("/api/objects/1/past"))["spans"]) == 1
    shutil.rmtree(store.folder)
    assert await served.get(path) == (status, {"error": error})


async def test_a_lost_segment_is_a_gap(served: ServedSite) -> None:
    store = served.service.recorder.folder
    assert store is not None
    assert store.session is not None
    store.session.paths.camera_file(A, 0).unlink()
    (store.session.paths.camera_file(A, 2 * GOP)).write_bytes(b"cut short")
    spans = (await served.get_json("/api/cameras/c0/past"))["spans"]
    assert [span["first"] for span in spans] == [4 * GOP]
    assert [span["first"] for span in (await served.get_json("/api/cameras/c1/past"))["spans"]] == [0]
    status, body = await fetch(served, "/cameras/c0/live.mp4?from=p0&to=p30")
    assert status == 200
    assert len(body) > 1000


async def test_requests_for_unreadable_recordings_are_answered_with_an_error() -> None:
    with unprivileged_folder() as tmp_path:
        async for served in serve_site(record={"folder": str(tmp_path / "kept"), "segment_s": 0.4}):
            await record_gops(served)
            store = served.service.recorder.folder
            assert store is not None
            assert store.session is not None
            (store.session.folder / "cameras" / "c0").chmod(0)
            error = {"error": "cannot read the recording: Permission denied"}
            assert await served.get("/cameras/c0/live.mp4?from=p0&to=p10") == (503, error)
            assert await served.get("/api/cameras/c0/past") == (503, error)
            (store.session.folder / "cameras" / "c0").chmod(0o700)
            assert (await fetch(served, "/cameras/c0/live.mp4?from=p0&to=p10"))[0] == 200


async def test_stopped_and_resumed_recording_is_reported(served: ServedSite) -> None:
    store, writer = served.service.recorder.folder, served.service.recorder.writer
    assert store is not None
    assert writer is not None
    writer._retry_s = 0.0
    shutil.rmtree(store.folder)
    store.folder.write_text("of another program\n")
    served.service.feed(7, {A: {1: LARGE}, B: {1: SMALL}})
    await until(lambda: writer.lost == 1)
    assert b"myview_recording 0.0" in (await fetch(served, "/metrics"))[1]
    served.service.pulses.newest = served.service.decision_state.end
    served.service.pulses.received_at = asyncio.get_running_loop().time()
    assert await fetch(served, "/readyz") == (200, b"2 of 2 cameras; nothing is recorded: File exists\n")
    store.folder.unlink()
    served.service.feed(8, {A: {1: LARGE}, B: {1: SMALL}})
    await until(lambda: written(served) == 7)
    assert b"myview_recording 1.0" in (await fetch(served, "/metrics"))[1]
    assert await fetch(served, "/readyz") == (200, b"2 of 2 cameras\n")
    status, body = await fetch(served, f"/objects/1/best.mp4?from=p{7 * GOP}&to=p{8 * GOP}")
    assert status == 200
    assert body
