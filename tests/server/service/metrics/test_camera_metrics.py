"""What is measured of a camera is of its present run, of late, and by its own clock."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.service.scripted_cameras import SMALL, word
from server.messaging.messages import FrameHeader, SolverReport
from server.service.metrics.camera_metrics import CameraMetrics, RecentSeconds


def head(pulse: int, late: float, due: float = 100.0) -> FrameHeader:
    return FrameHeader(pulse=pulse, key=False, boot=1, due=due, taken=due + late, encoded=due + late)


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=600))
def test_the_error_is_that_of_the_last_frames(errors: list[float]) -> None:
    gauge = CameraMetrics()
    assert gauge.sync_error is None
    for pulse, late in enumerate(errors):
        gauge.frame(head(pulse, late, due=0.0))
    last = sorted(errors[-250:])
    spread = gauge.sync_error
    assert spread is not None
    assert last[(len(last) - 1) // 2] <= spread.median <= last[len(last) // 2]
    assert abs(spread.worst) == max(map(abs, last))


def test_a_windows_delay_is_from_when_its_last_frame_was_due() -> None:
    gauge = CameraMetrics()
    said = word("c0", 0, {1: SMALL}, solved_at=100.5)
    gauge.window(said)  # of a frame that did not come
    assert gauge.tracking_delay is None
    gauge.frame(head(said.last, 0.1))
    gauge.window(said)
    assert gauge.tracking_delay == RecentSeconds(0.5, 0.5)
    assert gauge.size == said.size


@pytest.mark.parametrize(("gaps", "share"), [([], None), ([0.0], 1.0), ([0.0, 0.1, 1e-12, 0.0], 0.75)])
def test_a_window_is_certified_where_nothing_can_be_better(gaps: list[float], share: float | None) -> None:
    gauge = CameraMetrics()
    for gap in gaps:
        solve = SolverReport(objective=-4.0, bound=-4.0, gap=gap, integral=False, rounds=1)
        gauge.window(msgspec.structs.replace(word("c0", 0, {}), solve=solve))
    gauge.window(word("c0", 1, {}))  # nobody there, nothing solved
    assert (gauge.certified, gauge.windows) == (share, len(gaps))


def test_another_run_is_measured_anew_but_what_went_wrong_is_remembered() -> None:
    gauge = CameraMetrics(now=lambda: 7.0)
    gauge.frame(head(0, 0.1))
    gauge.record_problem("it went\nwrong")
    gauge.reset_recent()
    assert gauge.sync_error is None
    assert gauge.last_error is not None
    assert (gauge.last_error.text, gauge.last_error.at) == ("it went wrong", 7.0)
