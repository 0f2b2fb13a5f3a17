"""A slow or full disk loses GOPs of the recording, and affects nothing else."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from fakes.service.scripted_cameras import (
    CAMERAS,
    GOP,
    SMALL,
    FedService,
    TrackNumbers,
    encoded,
    small_config,
    video,
)
from fakes.service.scripted_recordings import A, B, gop_record, pictures
from fakes.timeouts import PATIENCE
from server.service.recording.recording_folder import GopRecord
from server.service.recording.writer_thread import WriterThread
from server.system.errors import UserError


class Disk:
    """A disk that can be slow or full; records the first pulses of written GOPs, and -1 when closed."""

    def __init__(self) -> None:
        self.events: list[int] = []
        self.is_full = False
        self.abandoned = 0
        self.responds = threading.Event()
        self.responds.set()
        self.write_started = threading.Semaphore(0)

    def write(self, record: GopRecord) -> None:
        self.write_started.release()
        assert self.responds.wait(PATIENCE)
        if self.is_full:
            raise OSError(28, "No space left on device", "c0/000.mp4")
        self.events.append(record.choices.first)

    def abandon(self) -> None:
        self.abandoned += 1

    def close(self) -> None:
        self.events.append(-1)


def writer_on(disk: Disk, most: int = 4, retry_s: float = 0.0) -> WriterThread:
    writer = WriterThread(disk.write, disk.abandon, disk.close, most, retry_s)
    writer.start()
    return writer


def test_queued_gops_are_written_before_the_end() -> None:
    disk = Disk()
    writer = writer_on(disk, most=100)
    for gop in range(20):
        writer.put(gop_record(gop, {1: A}))
    writer.close()
    assert disk.events == [*range(0, 20 * GOP, GOP), -1]
    assert (writer.written, writer.lost) == (20, 0)


def test_a_slow_disk_loses_whole_gops_without_blocking() -> None:
    disk = Disk()
    disk.responds.clear()
    writer = writer_on(disk, most=4)
    writer.put(gop_record(0, {1: A}))
    assert disk.write_started.acquire(timeout=PATIENCE), "the first one is being written"
    for gop in range(1, 20):
        writer.put(gop_record(gop, {1: A}))
    assert writer.lost == 15
    disk.responds.set()
    writer.close()
    assert disk.events == [0, 5, 10, 15, 20, -1]


def test_a_full_disk_is_logged_once_retried_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    disk = Disk()
    disk.is_full = True
    writer = writer_on(disk, most=100)
    for gop in range(3):
        writer.put(gop_record(gop, {1: A}))
        assert disk.write_started.acquire(timeout=PATIENCE)
    while writer.lost < 3:
        threading.Event().wait(0.001)
    assert writer.error_text == "No space left on device"
    disk.is_full = False
    writer.put(gop_record(3, {1: A}))
    writer.close()
    assert (disk.events, disk.abandoned) == ([15, -1], 3)
    assert (writer.written, writer.lost, writer.error_text) == (1, 3, "")
    failed, continued = (record.getMessage() for record in caplog.records)
    assert failed.startswith("recording: cannot write: No space left on device; nothing is recorded")
    assert continued.startswith("recording: continues after ")


def test_a_disk_that_is_full_repeatedly_is_not_logged_each_time(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO)
    disk = Disk()
    writer = writer_on(disk, most=100)
    for gop in range(0, 20, 2):
        disk.is_full = True
        writer.put(gop_record(gop, {1: A}))
        until(lambda gop=gop: writer.lost == gop // 2 + 1)
        disk.is_full = False
        writer.put(gop_record(gop + 1, {1: A}))
        until(lambda gop=gop: writer.written == gop // 2 + 1)
    writer.close()
    assert len(caplog.messages) == 2


def until(condition: Callable[[], bool]) -> None:
    """Wait for the writer's thread."""
    while not condition():
        threading.Event().wait(0.001)


def test_a_disk_that_does_not_respond_is_reported() -> None:
    disk = Disk()
    disk.responds.clear()
    writer = writer_on(disk)
    writer.put(gop_record(0, {1: A}))
    assert disk.write_started.acquire(timeout=PATIENCE)
    assert writer._writing_since is not None
    writer._writing_since -= 1000.0
    assert writer.problem.startswith("the disk has not responded for 10")
    disk.responds.set()
    until(lambda: writer.written == 1)
    until(lambda: not writer.problem)
    writer.close()


def test_an_internal_error_does_not_end_the_recording(caplog: pytest.LogCaptureFixture) -> None:
    class FailingDisk(Disk):
        def write(self, record: GopRecord) -> None:
            if not self.events:
                self.events.append(-2)
                raise ValueError("unexpected")
            super().write(record)

    disk = FailingDisk()
    writer = writer_on(disk, most=100)
    for gop in range(3):
        writer.put(gop_record(gop, {1: A}))
    writer.close()
    assert disk.events == [-2, 5, 10, -1]
    assert (writer.written, writer.lost, writer.error_text) == (2, 1, "")
    assert "internal error" in caplog.text


def test_a_full_disk_is_retried_only_after_a_while() -> None:
    disk = Disk()
    disk.is_full = True
    writer = writer_on(disk, most=100, retry_s=1000.0)
    for gop in range(10):
        writer.put(gop_record(gop, {1: A}))
    writer.close()
    assert (disk.abandoned, writer.lost) == (1, 10)


def make_service(folder: Path) -> FedService:
    service = FedService(small_config(record={"folder": str(folder), "segment_s": 1.0}))
    service.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    service.connect_cameras(*CAMERAS)
    return service


def test_a_service_records_what_it_decides(tmp_path: Path) -> None:
    service = make_service(tmp_path / "kept")
    service.recorder.open()
    for epoch in range(7):
        service.feed(epoch, {A: {1: SMALL}, B: {}})
    service.close()
    session = service.recorder.session
    assert session is not None
    assert [pulse for pulse, _ in pictures(session.objects[1].path)] == list(range(6 * GOP))
    assert [pulse for pulse, _ in pictures(session.cameras[B].path)] == list(range(6 * GOP))


def test_pictures_that_arrive_after_the_decision_are_recorded_too(tmp_path: Path) -> None:
    service = make_service(tmp_path / "kept")
    service.recorder.open()
    for epoch in range(7):
        service.feed(epoch, {A: {1: SMALL}})
    for unit in encoded(1)[: 7 * GOP]:
        service.ingest.receive_video(video(B, unit))
    service.feed(7, {A: {1: SMALL}})
    service.close()
    session = service.recorder.session
    assert session is not None
    decided = service.recorder.recent.end
    assert decided >= 5 * GOP
    for camera in CAMERAS:
        assert [pulse for pulse, _ in pictures(session.cameras[camera].path)] == list(range(decided))


def test_an_unusable_folder_is_a_one_line_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"record\.folder: .*file: cannot write there"):
        make_service(tmp_path / "file").recorder.open()
    first = make_service(tmp_path / "kept")
    first.recorder.open()
    with pytest.raises(UserError, match="another process records there"):
        make_service(tmp_path / "kept").recorder.open()
    first.close()


def test_nothing_is_written_without_a_configured_folder() -> None:
    service = FedService(small_config())
    service.recorder.open()
    assert service.recorder.session is None
    service.close()
