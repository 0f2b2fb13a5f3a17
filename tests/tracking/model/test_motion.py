"""The motion model: predicted positions, and the cost of deviating from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracking.interpolation import interpolate_gaps
from tracking.model.motion import MotionModel
from tracking.model.network import Network, build_network
from tracking.model.object_state import Template
from tracking.model.settings import CostSettings
from tracking.types import Detections

FPS = 25.0
"""The default."""
BOX = np.array([100.0, 100.0, 140.0, 200.0])
RIGHT = np.array([5.0, 0.0, 5.0, 0.0])
APPEARANCE, OTHER_APPEARANCE = np.array([1.0, 0.0]), np.array([0.0, 1.0])


def walked(frames: int = 12) -> MotionModel:
    boxes = np.stack([BOX + n * RIGHT for n in range(frames)])
    return MotionModel.of(range(frames), boxes, frames)


def window(
    motion: MotionModel | None,
    settings: CostSettings,
    *boxes: np.ndarray,
    appearance: np.ndarray = APPEARANCE,
) -> Network:
    """Return a window of one hidden object and one box a frame."""
    frames = [Detections(box[None], np.ones(1), appearance[None]) for box in boxes]
    return build_network([Template(1, APPEARANCE, None, motion)], frames, settings)


def test_the_predicted_velocity_decays_with_time() -> None:
    motion = walked()
    steps = np.diff(motion.predict(60)[:, 0])
    assert 4.0 < steps[0] < 5.0
    assert np.all(np.diff(steps) < 0.0)
    assert np.all(motion.damped_elapsed(1000) <= 0.8)
    assert np.ptp(motion.predict(60)[:, [1, 3]], axis=0) == pytest.approx([0.0, 0.0])


def test_one_observation_gives_no_velocity() -> None:
    motion = MotionModel.of([7], BOX[None], 9)
    assert motion.velocity == pytest.approx([0.0, 0.0])
    assert motion.elapsed == 2
    assert motion.predict(3) == pytest.approx(np.stack([BOX] * 3))


@given(st.lists(st.integers(1, 5), min_size=1, max_size=11), st.integers(1, 50))
def test_a_velocity_is_never_overestimated_from_any_frames(gaps: list[int], after: int) -> None:
    frames = [int(n) for n in np.cumsum([0, *gaps])]
    motion = MotionModel.of(frames, np.stack([BOX + n * RIGHT for n in frames]), frames[-1] + after)
    assert 0.0 < motion.velocity[0] <= 5.0 * FPS
    assert motion.velocity[1] == pytest.approx(0.0)


def test_reappearance_is_gated_by_predicted_position_and_appearance() -> None:
    settings, motion = CostSettings(), walked()
    expected = motion.predict(2)
    near = window(motion, settings, *expected)
    assert np.isfinite(near.source[0, 0])
    assert np.isfinite(near.pair[0, 0, 1, 0])
    far = window(motion, settings, *(expected + np.array([90.0, 0.0, 90.0, 0.0])))
    assert np.isinf(far.source[0, 0])
    assert np.isinf(far.pair[0, 0, 1, 0])
    assert np.isfinite(far.pair[0, 0, 0, 0]), "a visible object is not gated by motion"
    unlike = window(motion, settings, *expected, appearance=OTHER_APPEARANCE)
    assert np.isinf(unlike.pair[0, 0, 1, 0])
    paper = replace(settings, reappearance=0.0, motion=0.0)
    assert np.isfinite(window(motion, paper, *(expected + 500.0)).pair[0, 0, 1, 0])


def test_reappearance_costs_more_the_farther_from_the_prediction() -> None:
    motion = walked()
    costs = [
        window(motion, CostSettings(), *(motion.predict(2) + np.array([x, 0.0, x, 0.0]))).pair[0, 0, 1, 0]
        for x in (0.0, 5.0, 10.0, 15.0)
    ]
    assert np.all(np.diff(costs) > 0.0)


def test_an_object_without_motion_model_is_not_gated() -> None:
    assert np.isfinite(window(None, CostSettings(), BOX, BOX + 400.0).pair).any(axis=None)
    assert np.isfinite(window(None, CostSettings(), BOX, BOX + 400.0).pair[0, 0, 1, 0])


def test_short_gaps_are_interpolated_and_long_ones_are_not() -> None:
    seen = {0: BOX, 3: BOX + 3 * RIGHT, 9: BOX}
    boxes = np.full((12, 4), np.nan)
    for frame, box in seen.items():
        boxes[frame] = box
    filled = interpolate_gaps(boxes, None, 3)
    assert filled[:4] == pytest.approx(np.stack([BOX + n * RIGHT for n in range(4)]))
    assert np.isnan(filled[4:9]).all()
    assert np.isnan(filled[10:]).all(), "nothing is extrapolated"
    assert np.isnan(boxes[1]).all(), "the input is unchanged"


def test_a_gap_that_began_before_the_window_is_interpolated() -> None:
    boxes = np.full((4, 4), np.nan)
    boxes[2] = BOX + 2 * RIGHT
    filled = interpolate_gaps(boxes, (-2, BOX - 2 * RIGHT), 5)
    assert filled[:3] == pytest.approx(np.stack([BOX + n * RIGHT for n in range(3)]))
    assert np.isnan(interpolate_gaps(boxes, (-20, BOX), 5)[:2]).all()
