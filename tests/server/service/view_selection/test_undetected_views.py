"""A person whom one camera misses may still be shown by it if another camera locates them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.service.scripted_cameras import (
    CAMERAS,
    STRIDE,
    TrackNumbers,
    camera_tracks,
    epoch_of,
    small_config,
)
from server.messaging.messages import Box
from server.service.decision_state import reason
from server.service.view_selection.decider import GopDecision, ViewDecider
from server.service.view_selection.undetected_view_inference import UndetectedViewInference
from server.service.view_selection.undetected_views import TestedViews as Looked
from server.service.view_selection.undetected_views import UndetectedViews
from server.service.view_selection.view_quality_buffer import ViewQualityBuffer

A, B = CAMERAS
GROUND = {A: np.eye(3), B: np.diag([0.5, 0.5, 1.0])}
"""Both look straight down, B from half the height: people appear twice as large."""
UNCALIBRATED: dict[str, np.ndarray | None] = {A: np.eye(3), B: None}
CameraBoxes = Mapping[str, Mapping[int, Box | None]]


def at(x: float, y: float, camera: str = A) -> Box:
    """Return the box of a person whose feet are at a point of A's picture."""
    scale = 1.0 if camera == A else 2.0
    return scale * (x - 2.0), scale * (y - 10.0), scale * (x + 2.0), scale * y


def decider(ground: Mapping[str, np.ndarray | None] = GROUND, **view: Any) -> ViewDecider:
    view_decider = ViewDecider(small_config(view=view), ground, lambda _camera, _pulse: True)
    view_decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    return view_decider


def decide(view_decider: ViewDecider, story: Sequence[CameraBoxes]) -> list[GopDecision]:
    epochs = (
        epoch_of(number, *(camera_tracks(camera, number, boxes) for camera, boxes in boxes_of_camera.items()))
        for number, boxes_of_camera in enumerate(story)
    )
    return [decision for epoch in epochs for decision in view_decider.step(epoch)]


def shown(decisions: Sequence[GopDecision], number: int = 1) -> list[str | None]:
    return [choice.camera for decision in decisions for choice in decision.choices if choice.number == number]


PLACE = 15.0, 20.0
LOST = {3: at(26.0, 14.0)}
"""A person whom B never detects: evidence that B misses people."""
FOUND: CameraBoxes = {A: {1: at(*PLACE), **LOST}, B: {1: at(*PLACE, B)}}
COVERED: CameraBoxes = {A: FOUND[A], B: {1: None, 2: at(17.0, 20.0, B)}}
"""Another person's box covers person 1 in B."""
GONE: CameraBoxes = {A: FOUND[A], B: {1: None}}


def test_a_person_missed_beside_another_is_still_shown_where_larger() -> None:
    story = [FOUND] * 20 + [COVERED] * 12
    assert shown(decide(decider(undetected_weight=0.0), story))[-1] == A, "missed for too long"
    assert shown(decide(decider(), story)) == [B] * 31
    assert shown(decide(decider(UNCALIBRATED), story))[-1] == A, "without a homography the view is unknown"


def test_without_any_box_the_person_is_assumed_occluded() -> None:
    views = shown(decide(decider(), [FOUND] * 20 + [GONE] * 12))
    assert views[:20] == [B] * 20
    assert views[-1] == A


def test_a_person_missed_by_a_reliable_camera_is_hidden() -> None:
    story = [{A: {1: at(*PLACE)}, B: boxes_of_camera[B]} for boxes_of_camera in [FOUND] * 100 + [COVERED] * 4]
    views = shown(decide(decider(presence_decay_s=0.0), story))
    assert views[98] == B
    assert views[-1] == A


def test_no_view_is_inferred_where_a_camera_never_detects() -> None:
    learned = [COVERED] * 60
    assert shown(decide(decider(presence_decay_s=0.0), [FOUND, *learned]))[-1] == A
    assert shown(decide(decider(presence_decay_s=0.0), [FOUND] * 60 + learned[:12]))[-1] == B


@pytest.mark.parametrize("reports", [False, True], ids=["silent", "without detection"])
def test_nothing_is_learned_about_a_disconnected_camera(reports: bool) -> None:
    view_decider = decider()
    decide(view_decider, [FOUND] * 20)
    rates = view_decider._undetected_view_inference._detection_probability._cell_rate.copy()
    for number in range(20, 40):
        empty = camera_tracks(
            B, number, {}, without_detection=[*range(number * STRIDE, (number + 1) * STRIDE)]
        )
        view_decider.step(epoch_of(number, camera_tracks(A, number, FOUND[A]), *([empty] if reports else [])))
    changed = np.abs(view_decider._undetected_view_inference._detection_probability._cell_rate - rates)
    assert changed.max() < 0.05, "only forgetting changes it"


def test_a_person_outside_the_picture_is_not_expected_in_it() -> None:
    boxes = {A: {1: at(*PLACE), 2: at(60.0, 40.0)}, B: {1: at(*PLACE, B)}}
    decisions = decide(decider(), [boxes] * 20)
    assert shown(decisions, 2) == [A] * 19
    assert decisions[-1].reasons.of(2).views[B].undetected == 0.0


def test_the_explanation_includes_undetected_views_and_their_quality() -> None:
    decisions = decide(decider(), [FOUND] * 20 + [COVERED] * 6)
    reasons = decisions[-1].reasons.of(1)
    assert (reasons.views[A].seen, reasons.views[A].undetected) == (1.0, 0.0)
    assert (reasons.views[B].seen, reasons.views[B].undetected) == (0.0, 1.0)
    assert reasons.views[B].quality is None
    seen_quality = reasons.views[A].quality
    undetected_quality = reasons.views[B].undetected_quality
    assert seen_quality is not None
    assert undetected_quality is not None
    assert undetected_quality == pytest.approx(2.0 * seen_quality), (
        "twice as large, and B detects people reliably"
    )
    assert reasons.views[B].cost == pytest.approx(0.0)
    assert reason(decisions[-1].choices[0], reasons).startswith("c1 does not detect this person, but")


@pytest.mark.parametrize("frames", [1, 4, 10, 13, 25])
def test_an_observation_counts_for_the_frames_up_to_the_next_one(
    frames: int,
) -> None:
    inference = UndetectedViewInference(small_config(), ViewQualityBuffer(small_config(), GROUND, {}))
    frames_tested = np.array([0, 10, 20])
    cameras, feet = np.zeros(3, int), np.full((3, 2), 20.0)
    tested = Looked(frames_tested, cameras, feet, np.ones(3, dtype=np.bool_))
    inference.learn(replace(UndetectedViews.empty(), tested=tested), frames)
    assert inference._detection_probability._counts[0].sum() == frames, "each decided frame counts once"


def test_the_weight_scales_the_quality_of_undetected_views() -> None:
    story = [FOUND] * 20 + [COVERED] * 6
    whole, half = (
        decide(decider(undetected_weight=weight), story)[-1].reasons.of(1).views[B] for weight in (1.0, 0.5)
    )
    assert half.undetected_quality == pytest.approx(0.5 * (whole.undetected_quality or 0.0))


PLACES = st.sampled_from([(10.0, 15.0), (14.0, 18.0), (26.0, 22.0), (40.0, 30.0)])
PERSON = st.tuples(PLACES, st.booleans(), st.booleans())
STORY = st.lists(st.tuples(PERSON, PERSON, PERSON), min_size=6, max_size=20)


def boxes_at(moment: Sequence[tuple[tuple[float, float], bool, bool]]) -> CameraBoxes:
    return {
        camera: {
            number: at(*place, camera) if detected[CAMERAS.index(camera)] else None
            for number, (place, *detected) in enumerate(moment, start=1)
        }
        for camera in CAMERAS
    }


@settings(deadline=None, max_examples=15)
@given(STORY)
def test_shards_select_views_as_a_single_service(
    story: list[tuple[tuple[tuple[float, float], bool, bool], ...]],
) -> None:
    moments = [boxes_at(moment) for moment in story]
    single = decide(decider(), moments)
    for index in range(2):
        part = decide(decider(sharding={"of": 2, "index": index}), moments)
        for expected, actual in zip(single, part, strict=True):
            choices = [choice for choice in expected.choices if choice.number % 2 == index]
            assert list(actual.choices) == choices
            for choice in actual.choices:
                assert actual.reasons.of(choice.number) == expected.reasons.of(choice.number)
