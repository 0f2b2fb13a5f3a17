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
MOST_GROWTH = 200_000
"""Bytes; the detections of one window are about as much."""


@pytest.mark.slow
def test_the_tracker_holds_no_more_after_hundreds_of_frames() -> None:
    settings = WindowSettings(forget_after=50, max_objects=8)
    tracker = OnlineTracker(settings, CostSettings(), create_solver("columns"))
    scene = crowd(2, seed=1)
    objects, held = 0, 0
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
                held = tracemalloc.get_traced_memory()[0]
        assert tracemalloc.get_traced_memory()[0] - held < MOST_GROWTH
    finally:
        tracemalloc.stop()
    assert objects > 2  # somebody came after somebody had gone


def test_the_crowd_goes_on_and_changes() -> None:
    counts = [len(seen) for seen in itertools.islice(crowd(3, seed=2), 300)]
    assert min(counts) < max(counts)


def test_growth_is_that_of_a_straight_line() -> None:
    samples = MemorySamples([1000, 2000, 3000], [50.0, 50.5, 51.0], [1.0, 3.0, 5.0], [700, 700, 700])
    assert samples.growth() == pytest.approx(5.0)
    assert samples.block_growth() == pytest.approx(0.0, abs=1e-6)
    assert samples.milliseconds_per_frame() == pytest.approx(2.0)
    assert samples.between(1000, 3000).frames == [2000, 3000]


def test_a_run_has_three_spans_at_least() -> None:
    assert next(iter(spans(50_000))) == (0, 10_000)
    assert len(list(spans(50_000))) == 5
    assert list(spans(3000)) == [(0, 1000), (1000, 2000), (2000, 3000)]


def test_the_memory_of_this_process_is_read() -> None:
    held = resident_megabytes()
    # Fresh from the system: an array may be given what was let go of before.
    with mmap.mmap(-1, 32_000_000) as block:
        block.write(b"x" * 32_000_000)
        assert resident_megabytes() - held > 16.0


@pytest.mark.slow
def test_a_run_is_described_by_its_spans(capsys: pytest.CaptureFixture[str]) -> None:
    run = run_tracker(1500)  # the fewest that have six samples
    describe(Report(), run)
    printed = capsys.readouterr().out
    assert "1000 to 1500" in printed
    assert "growth after the first 500 frames" in printed
