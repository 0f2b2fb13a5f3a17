"""When the gateway sends a sample: evenly, at most a little early, and on time again after a jump."""

from __future__ import annotations

import pytest

from server.rtsp.presentation_clock import JUMP_S, PresentationClock

GOP_S = 0.4


def test_the_frames_of_a_gop_that_arrive_at_once_are_sent_at_their_own_pace() -> None:
    clock = PresentationClock(1.0)
    due = [clock.due(100 + frame / 25, 5.0, is_key=frame == 0) for frame in range(10)]
    assert due == pytest.approx([5.0 + frame / 25 for frame in range(10)])


def test_a_late_gop_keeps_its_time() -> None:
    clock = PresentationClock(1.0)
    clock.due(100.0, 5.0, is_key=True)
    assert clock.due(100.4, 5.9, is_key=True) == pytest.approx(5.4, abs=0.01)


@pytest.mark.parametrize("drift", [1 + 1e-4, 1 - 1e-4])
def test_clocks_that_drift_apart_stay_within_the_slack_for_a_day(drift: float) -> None:
    clock, day = PresentationClock(1.0), 86_400
    early = [
        clock.due(gop * GOP_S, gop * GOP_S * drift, is_key=True) - gop * GOP_S * drift
        for gop in range(int(day / GOP_S))
    ]
    assert min(early) >= -0.01
    assert max(early) <= 1.01


@pytest.mark.parametrize("jump", [-3600.0, JUMP_S + 3, 1e6])
def test_after_a_jump_of_media_time_the_next_frame_is_due_at_once(jump: float) -> None:
    clock = PresentationClock(1.0)
    clock.due(4000.0, 5.0, is_key=True)
    assert clock.due(4000.0 + jump, 6.0, is_key=True) == pytest.approx(6.0)


def test_no_time_is_negative() -> None:
    clock = PresentationClock(0.0)
    clock.due(10.0, 0.0, is_key=True)
    assert clock.due(9.5, 0.1, is_key=True) == 0.0


def test_without_slack_nothing_is_held_back_and_later_frames_keep_their_pace() -> None:
    clock = PresentationClock(0.0)
    burst = [clock.due(100 + frame / 25, 5.0, is_key=frame == 0) for frame in range(10)]
    assert burst == pytest.approx([5.0] * 10)
    jitter = [0.0, 0.03, 0.01, 0.0, 0.02]
    live = [
        clock.due(100.4 + frame / 25, 5.04 + frame / 25 + late, is_key=False)
        for frame, late in enumerate(jitter)
    ]
    assert live == pytest.approx([5.04 + frame / 25 for frame in range(5)])
