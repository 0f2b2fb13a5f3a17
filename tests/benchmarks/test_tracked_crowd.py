"""The crowd that the live tracker is timed on."""

from __future__ import annotations

from benchmarks.solvers.random_windows import WindowSize
from benchmarks.solvers.tracked_crowd import track_crowd


def test_everybody_of_a_small_crowd_is_tracked_within_the_budget() -> None:
    found = track_crowd(WindowSize(4, 6), 1.0, 0)
    assert len(found.windows) == 5
    assert found.objects.max() == 4
    assert found.gaps.max() < 1e-9
    assert not found.stopped.any()
