"""A camera whose picture is not clear is shown only where no other sees the person."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from fakes.service.scripted_cameras import CAMERAS, TrackNumbers, camera_tracks, epoch_of, small_config
from server.messaging.camera_status import CONDITION_TEXTS
from server.messaging.messages import Box
from server.messaging.packed_arrays import pack_boxes
from server.service.view_selection.decider import ViewDecider
from tracking.types import PictureCondition

A, B = CAMERAS
LARGE, SMALL = (10.0, 4.0, 26.0, 44.0), (20.0, 20.0, 28.0, 40.0)
EPOCHS, WRONG_FROM = 20, 8
FAULTS = [condition for condition in CONDITION_TEXTS if condition != "clear"]


def shown(
    conditions: tuple[PictureCondition, PictureCondition],
    boxes: tuple[Box | None, Box | None] = (LARGE, SMALL),
    covered: Box | None = None,
) -> Sequence[str | None]:
    """Return the cameras that are shown while pictures are clear at first; A shows the person larger.

    `covered`: what is covered then in A's picture.
    """
    decider = ViewDecider(small_config(), dict.fromkeys(CAMERAS), lambda _camera, _pulse: True)
    decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    cameras = []
    for number in range(EPOCHS):
        now = conditions if number >= WRONG_FROM else ("clear", "clear")
        cover = pack_boxes([covered]) if covered is not None and number >= WRONG_FROM else b""
        messages = (
            camera_tracks(
                camera,
                number,
                {} if box is None else {1: box},
                condition=condition,
                covered=cover if camera == A else b"",
            )
            for camera, box, condition in zip(CAMERAS, boxes, now, strict=True)
        )
        for decision in decider.step(epoch_of(number, *messages)):
            cameras += [choice.camera for choice in decision.choices if choice.number == 1]
    return cameras


@pytest.mark.parametrize("fault", FAULTS)
def test_another_camera_that_sees_the_person_is_shown(fault: PictureCondition) -> None:
    cameras = shown((fault, "clear"))
    assert cameras[0] == A
    assert cameras[-1] == B


@pytest.mark.parametrize("condition", ["clear", "covered"])
def test_a_camera_is_covered_where_its_cover_is(condition: PictureCondition) -> None:
    left, top, right, bottom = LARGE
    assert shown((condition, "clear"), covered=(left - 2.0, top, right, bottom - 8.0))[-1] == B
    assert set(shown((condition, "clear"), covered=(right + 2.0, top, right + 40.0, bottom))) == {A}


def test_the_larger_view_is_shown_while_both_are_clear_or_neither_is() -> None:
    assert set(shown(("clear", "clear"))) == {A}
    assert set(shown(("noisy", "noisy"))) == {A}


def test_a_camera_that_alone_sees_the_person_is_still_shown() -> None:
    assert set(shown(("blurred", "clear"), (LARGE, None))) == {A}
