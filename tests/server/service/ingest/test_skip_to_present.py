"""A service that the present has left behind goes on with the present, and so does all that hangs on it."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from fakes.media.decoding import decodes_without_errors
from fakes.service.decisions import collect_decisions
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    GOP,
    LARGE,
    SMALL,
    STRIDE,
    FedService,
    camera_tracks,
    encoded,
    small_config,
    tracks,
    video,
)
from fakes.service.scripted_recordings import playable_files
from server.media.audio.aac import SAMPLES
from server.media.audio.audio_format import AudioFormat
from server.messaging.epochs import end_of_epoch
from server.service.streaming.audio_buffer import AudioBuffer, AudioFollower
from server.service.streaming.media_chunk import MediaChunk

HOUR = 3600 * FPS // STRIDE
"""Epochs."""
ENCODED = 40 // STRIDE
"""Epochs after which pictures are repeated, which begin with a key picture."""
BEFORE = 6


def sent(service: FedService, epoch: int, *cameras: str) -> None:
    """Send an epoch's frames and words of some cameras."""
    for seed, camera in enumerate(CAMERAS):
        if camera not in cameras:
            continue
        again = epoch % ENCODED
        for unit in encoded(seed)[again * STRIDE : (again + 1) * STRIDE]:
            service.ingest.video(video(camera, replace(unit, pulse=unit.pulse + (epoch - again) * STRIDE)))
        service.ingest.tracks(tracks(camera_tracks(camera, epoch, {1: LARGE if seed else SMALL})))


def lived(service: FedService, epochs: range) -> None:
    """Let all cameras send some epochs, and decide them."""
    for epoch in epochs:
        service.pulse = end_of_epoch(epoch, STRIDE)
        sent(service, epoch, *CAMERAS)
        service.decide()


@pytest.fixture
def service(tmp_path: Path) -> FedService:
    """A service that records and writes decisions, and has lived for some epochs."""
    service = FedService(small_config(record={"folder": str(tmp_path / "kept")}), out=tmp_path)
    service._decision_writer = service.loss_recorder.decision_writer = service._open_decision_files(tmp_path)
    service.recorder.open()
    service.connect_cameras(*CAMERAS)
    return service


@pytest.mark.parametrize("hours", [8, 24 * 365])
def test_a_service_that_was_suspended_skips_to_the_present(
    service: FedService, tmp_path: Path, hours: int
) -> None:
    decided = collect_decisions(service)
    lived(service, range(BEFORE))
    before = decided[-1].first + GOP
    then = hours * HOUR
    lived(service, range(then, then + BEFORE))
    firsts = [decision.first for decision in decided]
    assert firsts == [*range(0, before, GOP), *range(then * STRIDE, (then + BEFORE - 1) * STRIDE, GOP)]
    assert all(decision.choices[0].camera == "c1" for decision in decided[-3:]), (
        "all is known of what is of now"
    )
    assert service.decision_state.end == decided[-1].first + GOP
    service.close()
    rows = (tmp_path / "late.csv").read_text(encoding="utf-8").splitlines()[1:]
    assert f"{before + 1},,not decided up to {then * STRIDE}" in rows
    assert len(rows) < 50
    assert service.recorder.writer is not None
    assert (service.recorder.writer.written, service.recorder.writer.lost) == (len(decided), 0)
    for path in playable_files(tmp_path / "kept"):
        decodes_without_errors(path)


@pytest.mark.parametrize("minutes", [5, 8 * 60])
def test_streams_continue_after_a_skip_with_one_filler_picture_or_a_gap(
    service: FedService, minutes: int
) -> None:
    lived(service, range(BEFORE))
    channels = [service.splicer.decided_cameras["c0"], *service.splicer.persons.values()]
    viewers = [channel.subscribe() for channel in channels]
    until, then = service.decision_state.end, minutes * HOUR // 60 // ENCODED * ENCODED
    lived(service, range(then, then + BEFORE))
    for viewer in viewers:
        footage = [chunk for chunk in viewer._queue if isinstance(chunk, MediaChunk) and chunk.until > until]
        first, *more = [(chunk.first, chunk.until) for chunk in footage]
        expected = [
            (number, number + GOP) for number in range(then * STRIDE, service.decision_state.end, GOP)
        ]
        if minutes < 60:
            assert first == (until, then * STRIDE)
            assert len(footage[0].pictures) == 1
        else:
            assert first == expected.pop(0)
        assert more == expected
    service.close()


def test_a_backlog_of_a_minute_is_decided_epoch_by_epoch(service: FedService) -> None:
    decided = collect_decisions(service)
    lived(service, range(BEFORE))
    then = HOUR // 60
    lived(service, range(then, then + BEFORE))
    assert [decision.first for decision in decided] == list(range(0, service.decision_state.end, GOP)), (
        "nothing is left out"
    )
    service.close()


class Started(FedService):
    """One that runs, and is told of pulses when the test says so."""

    def __init__(self) -> None:
        super().__init__(small_config())
        self.connect_cameras(*CAMERAS)
        self.pulses: asyncio.Queue[int] = asyncio.Queue()

    async def _follow_pulses(self) -> None:
        while True:
            self.pulse = await self.pulses.get()
            self._changed.set()

    async def says(self, epoch: int, *cameras: str) -> None:
        """Let cameras speak of an epoch, and the service do what it does then."""
        sent(self, epoch, *cameras)
        self._changed.set()
        await self.does()

    async def does(self) -> None:
        """Let it do what it does."""
        for _ in range(50):
            await asyncio.sleep(0)


@pytest.mark.parametrize("other", [3, 3000 * HOUR], ids=["behind", "ahead"])
async def test_a_camera_that_counts_alone_does_not_determine_the_first_epoch(other: int) -> None:
    service, now = Started(), 720 * HOUR
    decided = collect_decisions(service)
    running = asyncio.create_task(service.run())
    await service.does()
    await service.says(other, "c0")
    await service.says(now, "c1")
    assert service.aligner._next is None, "nobody knows yet what is now"
    service.pulses.put_nowait(end_of_epoch(now, STRIDE))
    for epoch in range(now + 1, now + 4):
        sent(service, other + epoch - now, "c0")
        await service.says(epoch, "c1")
        service.pulses.put_nowait(end_of_epoch(epoch, STRIDE))
    await service.does()
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    assert [decision.first for decision in decided[:2]] == [now * STRIDE, now * STRIDE + GOP]
    service.close()


async def test_a_site_without_a_pulse_server_is_decided(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.service.pipeline._FIRST_PULSE_S", 0.0)
    service = Started()
    decided = collect_decisions(service)
    running = asyncio.create_task(service.run())
    for epoch in range(4):
        await service.says(epoch, *CAMERAS)
    assert [decision.first for decision in decided] == [0, GOP, 2 * GOP]
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    service.close()


def test_a_suspended_cameras_gap_is_not_filled_with_hours_of_pictures() -> None:
    following = AudioFollower(AudioBuffer(AudioFormat(48_000, 2), FPS, 10.0))
    following.next_audio(0, FPS)
    hours = 8 * 3600 * FPS
    heard = following.next_audio(hours, hours + FPS)
    assert (heard.first, len(heard.frames)) == (
        hours // FPS * 48_000 // SAMPLES,
        pytest.approx(47 / 2, abs=1),
    )
