"""The calibration benchmark: the overlap of two cameras by the ground truth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from benchmarks.calibration.calibration_errors import in_common
from tracking.motchallenge import MotRow, write_rows

TALL = 60.0


def write_truth(folder: Path, camera: str, frames: Sequence[int], feet: np.ndarray) -> None:
    """Write somebody whose feet (F, 2) are at these places of the picture."""
    rows = [
        MotRow(frame + 1, 1, x - 10, bottom - TALL, 20, TALL)
        for frame, (x, bottom) in zip(frames, feet, strict=True)
    ]
    write_rows(folder / f"{camera}.txt", rows)


def test_a_plane_is_found_though_some_feet_are_hidden_and_who_comes_later_is_not_in_common(
    tmp_path: Path,
) -> None:
    random = np.random.default_rng(1)
    feet = random.uniform((100, 100), (500, 300), (80, 2))
    across = 640 - feet  # half a turn, which is a homography
    across[:20, 1] -= 25  # a desk is before them
    write_truth(tmp_path, "a", range(80), feet)
    write_truth(tmp_path, "b", range(80), across)
    write_truth(tmp_path, "later", range(80, 160), feet)
    found = in_common(tmp_path, ("a", "b", "later"), (640, 700))
    assert (found["a", "b"].people, found["a", "b"].boxes) == (1, 80)
    assert found["a", "b"].off == pytest.approx(0.0, abs=1e-6)
    for other in ("a", "b"):
        assert (found[other, "later"].people, found[other, "later"].boxes) == (0, 0)
        assert np.isnan(found[other, "later"].off)


def test_feet_that_are_hidden_at_random_are_on_no_plane(tmp_path: Path) -> None:
    random = np.random.default_rng(2)
    feet = random.uniform((100, 100), (500, 300), (80, 2))
    write_truth(tmp_path, "a", range(80), feet)
    write_truth(tmp_path, "b", range(80), feet + random.normal(0, TALL, (80, 2)) * (0, 1) + (0, 200))
    off = in_common(tmp_path, ("a", "b"), (640, 900))["a", "b"].off
    assert off > 0.2
