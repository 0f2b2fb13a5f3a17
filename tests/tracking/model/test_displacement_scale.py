"""What is an ordinary displacement is measured: it costs the same with every detector and frame rate."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tracking import CostSettings, Detections
from tracking.model.displacement_scale import DisplacementScale
from tracking.model.settings import walking_displacement

FPS = 25.0
PEOPLE = np.array([[10.0 + 60.0 * place, 20.0, 40.0 + 60.0 * place, 120.0] for place in range(4)])


def walk(jitter: float, step: float, frames: int = 200, score: float = 0.9) -> list[Detections]:
    """Return people who walk by `step` pixels a frame, with errors of the boxes, in random order."""
    random = np.random.default_rng(3)
    found = []
    for frame in range(frames):
        boxes = PEOPLE + step * frame * np.array([1.0, 0.0, 1.0, 0.0])
        boxes = random.permutation(boxes) + random.uniform(-jitter, jitter, (len(PEOPLE), 4))
        found.append(Detections(boxes, np.full(len(PEOPLE), score), np.empty((len(PEOPLE), 0))))
    return found


def measured(found: list[Detections], fps: float = FPS) -> float:
    scale = DisplacementScale(fps)
    for before, after in pairwise(found):
        scale.add(before, after)
    return scale.ordinary


def test_steady_boxes_of_slow_people_move_as_expected() -> None:
    assert measured(walk(jitter=0.0, step=1.0)) == walking_displacement(FPS)


@pytest.mark.parametrize("step", [4.0, 6.0])
def test_fast_people_are_measured_in_heights(step: float) -> None:
    assert measured(walk(jitter=0.0, step=step)) == pytest.approx(step / 100.0, rel=0.05)


def test_boxes_that_jitter_move_more() -> None:
    steady, shaky = (measured(walk(jitter=jitter, step=1.0)) for jitter in (1.0, 6.0))
    assert shaky > 2.0 * steady


def test_doubtful_boxes_do_not_count() -> None:
    assert measured(walk(jitter=6.0, step=1.0, score=0.4)) == walking_displacement(FPS)


def test_frames_without_people_do_not_count() -> None:
    nobody = Detections.empty(0)
    assert measured([nobody, *walk(jitter=0.0, step=6.0), nobody]) == pytest.approx(0.06, rel=0.05)


@pytest.mark.parametrize("fps", [2.0, 7.0, 25.0, 60.0])
def test_an_ordinary_displacement_costs_the_same(fps: float) -> None:
    costs = CostSettings()
    ordinary = walking_displacement(25.0) * costs.displacement
    for displacement in (None, 0.05, 0.2):
        moved = walking_displacement(fps) if displacement is None else displacement
        assert costs.for_fps(fps, displacement).displacement * moved == pytest.approx(ordinary)


@pytest.mark.parametrize("gate", [0.05, 0.15, 0.2, 0.6])
def test_a_gate_is_as_set_where_boxes_are_steady_at_25_frames_a_second(gate: float) -> None:
    assert CostSettings(gate=gate).for_fps(25.0).gate == pytest.approx(gate)


def test_pixels_are_the_papers() -> None:
    pixels = replace(CostSettings(), displacement_unit="pixels", displacement=0.01, gate=None)
    assert pixels.for_fps(5.0, 0.3) is pixels
