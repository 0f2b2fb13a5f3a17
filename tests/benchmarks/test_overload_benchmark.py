"""The overload benchmark: its summaries, and a real overloaded site."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.common.process_load import lag_percentile
from benchmarks.overload.__main__ import load, summarize_step
from benchmarks.overload.growing_site import run_growing_site
from benchmarks.overload.overload_report import plot
from benchmarks.overload.responsiveness import Responsiveness, row
from benchmarks.overload.samples import LoadStep, OverloadResult, SiteSample

CALM = SiteSample(
    at=0.0, levels=(0, 0), pulses=1000, shed=100, missed=10, late=7, delays=(), missing_frames=0
)  # two cameras, of an earlier time


def test_a_step_counts_only_its_own_time() -> None:
    samples = [
        CALM,
        replace(CALM, at=1.0, levels=(0, 2), pulses=1100, shed=120, delays=(400.0, 500.0)),
        replace(
            CALM,
            at=2.0,
            levels=(1, 2),
            pulses=1200,
            shed=140,
            missed=12,
            late=9,
            delays=(600.0,),
            missing_frames=3,
        ),
    ]
    step = summarize_step(2, [CALM], samples)
    assert step.searched == pytest.approx(1.0 - 42 / 200)
    assert step.missed == pytest.approx(2 / 200)
    assert step.late == pytest.approx(2 / 40)
    assert step.levels == (0.5, 2)
    assert step.delays[0] == 500.0
    assert step.missing_frames == 3


def test_the_machine_carries_as_many_as_are_searched_whole() -> None:
    step = summarize_step(1, [CALM], [CALM, replace(CALM, pulses=2000)])
    result = OverloadResult(
        steps=[step, replace(step, cameras=2, searched=0.995), replace(step, cameras=3, searched=0.6)]
    )
    assert result.cameras_carried == 2
    assert OverloadResult(steps=[LoadStep(1, (3.0, 3), 0.2, 0.0, 0.0, (1.0, 1.0), 0)]).cameras_carried == 0


def test_what_was_found_is_drawn(tmp_path: Path) -> None:
    samples = [replace(CALM, at=float(second), delays=(400.0,)) for second in range(5)]
    plot(OverloadResult(samples=samples, started=[(0.0, 1), (3.0, 2)]), tmp_path / "load.png")
    assert (tmp_path / "load.png").stat().st_size > 1000


def test_who_was_not_answered_counts_with_the_time_that_they_waited() -> None:
    measured = Responsiveness(
        60.0, response_times=[(0.0, None), (1.0, 2.0), (10.0, 0.5), (20.0, None), (5.0, 1.5), (2.0, 9.0)]
    )
    assert measured.first_response_s == 3.0
    assert [measured.response_time(percent) for percent in (0, 50, 100)] == [0.5, 1.5, 40.0], (
        "those that came before are not counted"
    )
    assert Responsiveness(60.0, response_times=[(0.0, None)]).first_response_s == np.inf


def test_a_lag_is_told_by_the_bound_that_it_does_not_pass() -> None:
    lags = [(0.1, 90.0), (0.5, 95.0), (1.0, 95.0), (np.inf, 100.0)]
    assert [lag_percentile(share, lags) for share in (0.5, 0.95, 1.0)] == [0.1, 0.5, np.inf]


def test_frames_are_counted_at_the_end_and_what_is_not_known_is_told_so() -> None:
    frames = [(1.0, 0.0), (40.0, 100.0), (50.0, 600.0), (60.0, 1100.0)]
    measured = Responsiveness(60.0, frames=frames, lags=[(0.1, 1.0)])
    assert measured.rate == 50.0
    assert row(40, 10, measured)[:3] == ["40", "10", "inf"]
    assert np.isnan(Responsiveness(60.0, frames=frames[:1]).rate)


@pytest.mark.slow
def test_a_stream_has_no_hole_however_many_cameras_there_are(tmp_path: Path) -> None:
    with run_growing_site(3, tmp_path) as site:
        result = asyncio.run(load(site, 3, 10.0, 10.0))
    assert [step.cameras for step in result.steps][:2] == [1, 2]
    assert all(step.missing_frames == 0 for step in result.steps)
    assert all(np.isfinite(step.delays[0]) for step in result.steps)
