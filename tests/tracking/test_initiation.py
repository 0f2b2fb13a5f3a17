"""Track initiation: how many frames of a test period a new object is seen in, and where."""

from __future__ import annotations

import numpy as np
import pytest

from tracking import CostSettings, Detections, WindowSettings, create_solver
from tracking.lifecycle.initiation import Birth, find_births

FPS = 10.0
WINDOW = WindowSettings(length_s=1.0, birth_s=1.0, birth_min_visible=0.5).resolve(FPS)


def _walker(frames: range) -> list[Detections]:
    """Return the detections of somebody who walks, and is seen in these frames of the test period."""
    walk = [np.array([[100.0 + 4.0 * m, 50.0, 140.0 + 4.0 * m, 150.0]]) for m in range(WINDOW.birth_window)]
    return [
        Detections(box, np.ones(1), np.empty((1, 0))) if m in frames else Detections.empty(0)
        for m, box in enumerate(walk)
    ]


@pytest.mark.parametrize("first", range(6))
def test_somebody_seen_in_just_the_required_frames_is_found_wherever_these_are(first: int) -> None:
    births = _births(range(first, first + 5))
    assert [birth.offset for birth in births] == [first]


@pytest.mark.parametrize("first", range(7))
def test_somebody_seen_in_a_frame_less_is_not_found(first: int) -> None:
    assert not _births(range(first, first + 4))


def _births(frames: range) -> list[Birth]:
    detections = _walker(frames)
    unoccupied = [np.empty((0, 4))] * len(detections)
    return find_births(
        detections, unoccupied, WINDOW, CostSettings().for_fps(FPS), create_solver("separate-dp")
    )
