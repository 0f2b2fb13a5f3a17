"""A service that was suspended skips to the present, with its streams and recordings."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from fakes.media.decoding import decodes_without_errors
from fakes.service.decisions import collect_decisions
from fakes.service.running_service import ENCODED, RunningService, send_epoch
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    GOP,
    STRIDE,
    FedService,
    small_config,
)
from fakes.service.scripted_recordings import playable_files
from server.media.audio.aac import SAMPLES
from server.media.audio.audio_format import AudioFormat
from server.messaging.epochs import end_of_epoch
from server.service.decision_files.live_decision_writer import open_decision_files
from server.service.streaming.audio_buffer import AudioBuffer, AudioFollower
from server.service.streaming.media_chunk import MediaChunk

HOUR = 3600 * FPS // STRIDE
"""Epochs per hour."""
BEFORE = 6


def run_epochs(service: FedService, epochs: range) -> None:
    """Let all cameras send some epochs, and decide them."""
    for epoch in epochs:
        service.pulses.newest = end_of_epoch(epoch, STRIDE)
        send_epoch(service, epoch, *CAMERAS)
        service.decide()


@pytest.fixture
def service(tmp_path: Path) -> FedService:
    """A service that records and writes decisions."""
    service = FedService(small_config(record={"folder": str(tmp_path / "kept")}), out=tmp_path)
    service.decision_writer = service.loss_recorder.decision_writer = open_decision_files(
        tmp_path, CAMERAS, service.decider.people.letterboxes
    )
    service.recorder.open()
    service.connect_cameras(*CAMERAS)
    return service


@pytest.mark.parametrize("hours", [8, 24 * 365])
def test_a_service_that_was_suspended_skips_to_the_present(
    service: FedService, tmp_path: Path, hours: int
) -> None:
    decided = collect_decisions(service)
    run_epochs(service, range(BEFORE))
    before = decided[-1].first + GOP
    resumed = hours * HOUR
    run_epochs(service, range(resumed, resumed + BEFORE))
    firsts = [decision.first for decision in decided]
    assert firsts == [*range(0, before, GOP), *range(resumed * STRIDE, (resumed + BEFORE - 1) * STRIDE, GOP)]
    assert all(decision.choices[0].camera == "c1" for decision in decided[-3:]), "the present is fully known"
    assert service.decision_state.end == decided[-1].first + GOP
    service.close()
    rows = (tmp_path / "late.csv").read_text(encoding="utf-8").splitlines()[1:]
    assert f"{before + 1},,not decided up to {resumed * STRIDE}" in rows
    assert len(rows) < 50
    assert service.recorder.writer is not None
    assert (service.recorder.writer.written, service.recorder.writer.lost) == (len(decided), 0)
    for path in playable_files(tmp_path / "kept"):
        decodes_without_errors(path)


@pytest.mark.parametrize("minutes", [5, 8 * 60])
def test_streams_continue_after_a_skip_with_one_filler_picture_or_a_gap(
    service: FedService, minutes: int
) -> None:
    run_epochs(service, range(BEFORE))
    broadcasters = [service.splicer.decided_cameras["c0"], *service.splicer.persons.values()]
    viewers = [broadcaster.subscribe() for broadcaster in broadcasters]
    until, resumed = service.decision_state.end, minutes * HOUR // 60 // ENCODED * ENCODED
    run_epochs(service, range(resumed, resumed + BEFORE))
    for viewer in viewers:
        chunks = [chunk for chunk in viewer._queue if isinstance(chunk, MediaChunk) and chunk.until > until]
        first, *more = [(chunk.first, chunk.until) for chunk in chunks]
        expected = [
            (number, number + GOP) for number in range(resumed * STRIDE, service.decision_state.end, GOP)
        ]
        if minutes < 60:
            assert first == (until, resumed * STRIDE)
            assert len(chunks[0].pictures) == 1
        else:
            assert first == expected.pop(0)
        assert more == expected
    service.close()


def test_a_backlog_of_a_minute_is_decided_epoch_by_epoch(service: FedService) -> None:
    decided = collect_decisions(service)
    run_epochs(service, range(BEFORE))
    resumed = HOUR // 60
    run_epochs(service, range(resumed, resumed + BEFORE))
    assert [decision.first for decision in decided] == list(range(0, service.decision_state.end, GOP)), (
        "no epoch is skipped"
    )
    service.close()


@pytest.mark.parametrize("other", [3, 3000 * HOUR], ids=["behind", "ahead"])
async def test_a_camera_that_counts_alone_does_not_determine_the_first_epoch(other: int) -> None:
    service, now = RunningService(), 720 * HOUR
    decided = collect_decisions(service)
    running = asyncio.create_task(service.run())
    await service.process()
    await service.receive(other, "c0")
    await service.receive(now, "c1")
    assert service.aligner._next is None, "the present is not known yet"
    service.pulses.sent.put_nowait(end_of_epoch(now, STRIDE))
    for epoch in range(now + 1, now + 4):
        send_epoch(service, other + epoch - now, "c0")
        await service.receive(epoch, "c1")
        service.pulses.sent.put_nowait(end_of_epoch(epoch, STRIDE))
    await service.process()
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    assert [decision.first for decision in decided[:2]] == [now * STRIDE, now * STRIDE + GOP]
    service.close()


async def test_a_site_without_a_pulse_server_is_decided(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.service.pipeline._FIRST_PULSE_S", 0.0)
    service = RunningService()
    decided = collect_decisions(service)
    running = asyncio.create_task(service.run())
    for epoch in range(4):
        await service.receive(epoch, *CAMERAS)
    assert [decision.first for decision in decided] == [0, GOP, 2 * GOP]
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    service.close()


def test_a_suspended_cameras_gap_is_not_filled_with_hours_of_pictures() -> None:
    following = AudioFollower(AudioBuffer(AudioFormat(48_000, 2), FPS, 10.0))
    following.next_audio(0, FPS)
    hours = 8 * 3600 * FPS
    audio = following.next_audio(hours, hours + FPS)
    assert (audio.first, len(audio.frames)) == (
        hours // FPS * 48_000 // SAMPLES,
        pytest.approx(47 / 2, abs=1),
    )
