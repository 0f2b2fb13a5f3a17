"""The endurance benchmark in a short run: memory does not grow."""

from __future__ import annotations

import itertools
import mmap
import tracemalloc

import pytest

from benchmarks.common.report import Report
from benchmarks.endurance.__main__ import describe, run_tracker, spans
from benchmarks.endurance.endless_crowd import crowd
from benchmarks.endurance.memory_samples import MemorySamples, resident_megabytes
from tracking import CostSettings, OnlineTracker, WindowSettings, create_solver

WARM_UP, FRAMES = 400, 900
MAX_GROWTH = 200_000
"""Bytes: about the detections of one window."""


@pytest.mark.slow
def test_the_trackers_memory_does_not_grow_over_hundreds_of_frames() -> None:
    settings = WindowSettings(forget_after_s=2.0, max_objects=8).resolve(25.0)
    tracker = OnlineTracker(settings, CostSettings(), create_solver("columns"))
    scene = crowd(2, seed=1)
    objects, allocated = 0, 0
    try:
        for frame, seen in enumerate(itertools.islice(scene, FRAMES)):
            result = tracker.push(frame, seen)
            assert len(tracker._detections) <= settings.window
            assert len(tracker._objects) <= settings.max_objects
            if result is not None:
                objects = max([objects, *(track.id for track in result.tracks)])
            if frame == WARM_UP:
                tracemalloc.start()
            elif frame == WARM_UP + 50:
                allocated = tracemalloc.get_traced_memory()[0]
        assert tracemalloc.get_traced_memory()[0] - allocated < MAX_GROWTH
    finally:
        tracemalloc.stop()
    assert objects > 2, "people were replaced by others"


def test_the_number_of_people_in_the_crowd_varies() -> None:
    counts = [len(seen) for seen in itertools.islice(crowd(3, seed=2), 300)]
    assert min(counts) < max(counts)


def test_growth_is_the_slope_of_a_regression_line() -> None:
    samples = MemorySamples([1000, 2000, 3000], [50.0, 50.5, 51.0], [1.0, 3.0, 5.0], [700, 700, 700])
    assert samples.growth() == pytest.approx(5.0)
    assert samples.block_growth() == pytest.approx(0.0, abs=1e-6)
    assert samples.milliseconds_per_frame() == pytest.approx(2.0)
    assert samples.between(1000, 3000).frames == [2000, 3000]


def test_a_run_has_at_least_three_spans() -> None:
    assert next(iter(spans(50_000))) == (0, 10_000)
    assert len(list(spans(50_000))) == 5
    assert list(spans(3000)) == [(0, 1000), (1000, 2000), (2000, 3000)]


def test_resident_memory_includes_a_new_mapping() -> None:
    before = resident_megabytes()
    # A mapping of its own: an array may reuse freed memory.
    with mmap.mmap(-1, 32_000_000) as block:
        block.write(b"x" * 32_000_000)
        assert resident_megabytes() - before > 16.0


@pytest.mark.slow
def test_the_report_of_a_run_has_its_spans(capsys: pytest.CaptureFixture[str]) -> None:
    run = run_tracker(1500)  # the minimum: six samples
    describe(Report(), run)
    printed = capsys.readouterr().out
    assert "1000 to 1500" in printed
    assert "growth after the first 500 frames" in printed
