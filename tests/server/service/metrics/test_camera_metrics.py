"""Camera metrics are recent, of the current run, and by the camera's own clock."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.service.scripted_cameras import SMALL, camera_tracks
from server.messaging.messages import FrameHeader, SolverReport
from server.service.metrics.camera_metrics import CameraMetrics, RecentSeconds


def head(pulse: int, late: float, due: float = 100.0) -> FrameHeader:
    return FrameHeader(pulse=pulse, key=False, boot=1, due=due, captured_at=due + late, encoded=due + late)


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=600))
def test_the_synchronization_error_is_of_recent_frames(errors: list[float]) -> None:
    measured = CameraMetrics(25.0)
    assert measured.sync_error is None
    for pulse, late in enumerate(errors):
        measured.measure_frame(head(pulse, late, due=0.0))
    last = sorted(errors[-250:])
    spread = measured.sync_error
    assert spread is not None
    assert last[(len(last) - 1) // 2] <= spread.median <= last[len(last) // 2]
    assert abs(spread.worst) == max(map(abs, last))


@pytest.mark.parametrize("fps", [5.0, 25.0, 60.0])
def test_measured_are_the_last_ten_seconds_at_any_frame_rate(fps: float) -> None:
    measured, late = CameraMetrics(fps), camera_tracks("c0", 0, {1: SMALL}, solved_at=109.0)
    for pulse in range(late.last, late.last + round(9.0 * fps)):
        measured.measure_frame(head(pulse, 0.1, due=100.0 + (pulse - late.last) / fps))
    measured.measure_window(late)
    assert measured.tracking_delay == RecentSeconds(9.0, 9.0)
    for pulse in range(round(11.0 * fps)):
        measured.measure_frame(head(1000 + pulse, 0.0 if pulse >= fps else -0.5))
    assert measured.sync_error == RecentSeconds(0.0, 0.0)


def test_the_tracking_delay_counts_from_the_pulse_of_the_last_frame() -> None:
    measured = CameraMetrics(25.0)
    message = camera_tracks("c0", 0, {1: SMALL}, solved_at=100.5)
    measured.measure_window(message)  # of a missed frame
    assert measured.tracking_delay is None
    measured.measure_frame(head(message.last, 0.1))
    measured.measure_window(message)
    assert measured.tracking_delay == RecentSeconds(0.5, 0.5)
    assert measured.size == message.size


@pytest.mark.parametrize(("gaps", "share"), [([], None), ([0.0], 1.0), ([0.0, 0.1, 1e-12, 0.0], 0.75)])
def test_a_window_is_optimal_if_its_gap_is_zero(gaps: list[float], share: float | None) -> None:
    measured = CameraMetrics(25.0)
    for gap in gaps:
        solve = SolverReport(objective=-4.0, bound=-4.0, gap=gap, integral=False, rounds=1)
        measured.measure_window(msgspec.structs.replace(camera_tracks("c0", 0, {}), solve=solve))
    measured.measure_window(camera_tracks("c0", 1, {}))  # no detection, nothing solved
    assert (measured.optimal, measured.recent_solved_windows) == (share, len(gaps))


def test_a_new_run_resets_measurements_but_not_the_last_problem() -> None:
    measured = CameraMetrics(25.0, now=lambda: 7.0)
    measured.measure_frame(head(0, 0.1))
    measured.record_problem("it went\nwrong")
    measured.reset_recent()
    assert measured.sync_error is None
    assert measured.last_error is not None
    assert (measured.last_error.text, measured.last_error.at) == ("it went wrong", 7.0)
