"""Rules on a site's decisions: positions from boxes, events, reload, merges."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fakes.service.scripted_cameras import CAMERAS, HEIGHT, WIDTH, FedService, TrackNumbers, small_config
from server.config.loader import build_config
from server.config.site_config import Config
from server.messaging.messages import Box, GopChoices
from server.service.rules.engine import SiteEvent
from server.service.rules.positions import people_of_frames
from server.service.rules.setup import create_evaluator
from server.service.view_selection.decider import GopDecision

A, B = CAMERAS
LEFT: Box = (2.0, 10.0, 8.0, 28.0)
RIGHT: Box = (50.0, 10.0, 56.0, 28.0)
IDENTITY = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.001, 1.0]]
RIGHT_HALF = {"id": "right", "camera": "c0", "area": [[32, 0], [64, 0], [64, 48], [32, 48]], "hold_s": 0.04}
ENTERED = {"id": "in", "kind": "entered", "zone": "right"}


def site(*cameras: dict[str, Any], **changes: Any) -> FedService:
    service = FedService(small_config(cameras or CAMERAS, **changes))
    service.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    service.connect_cameras(*CAMERAS)
    return service


def events_of(service: FedService) -> list[SiteEvent]:
    events: list[SiteEvent] = []
    service.on_event.append(events.append)
    return events


def test_a_person_who_enters_a_zone_of_a_picture_is_reported() -> None:
    service = site(zones=[RIGHT_HALF], rules=[ENTERED])
    events = events_of(service)
    for epoch, box in enumerate([LEFT, LEFT, RIGHT, RIGHT, RIGHT]):
        service.feed(epoch, {A: {1: box}, B: {}})
    (event,) = events
    assert (event.rule, event.kind, event.zone, event.objects, event.pulse) == (
        "in",
        "entered",
        "right",
        [1],
        10,
    )
    assert event.camera == A
    assert service.rules.people_in == {"right": [1]}
    service.close()


def test_events_precede_no_decision() -> None:
    """Who receives a decision and then its events knows the pulses of both."""
    service = site(zones=[RIGHT_HALF], rules=[ENTERED])
    told: list[tuple[str, int]] = []
    service.on_decision.append(lambda choices: told.append(("gop", choices.first + choices.frames)))
    service.on_event.append(lambda event: told.append(("event", event.confirmed)))
    for epoch, box in enumerate([LEFT, LEFT, RIGHT, RIGHT, RIGHT]):
        service.feed(epoch, {A: {1: box}, B: {}})
    at = next(place for place, (kind, _) in enumerate(told) if kind == "event")
    assert told[at - 1][1] > told[at][1]
    service.close()


def test_reloaded_zones_apply_from_the_next_gop() -> None:
    service = site()
    events = events_of(service)
    for epoch in range(4):
        service.feed(epoch, {A: {1: RIGHT}, B: {}})
    assert events == []
    service.apply_config(small_config(zones=[RIGHT_HALF], rules=[ENTERED]))
    service.feed(4, {A: {1: RIGHT}, B: {}})
    assert [event.rule for event in events] == ["in"]
    service.close()


def test_an_unrelated_reload_keeps_who_is_where() -> None:
    service = site(zones=[RIGHT_HALF], rules=[ENTERED])
    events = events_of(service)
    for epoch in range(4):
        service.feed(epoch, {A: {1: RIGHT}, B: {}})
    service.apply_config(small_config(zones=[RIGHT_HALF], rules=[ENTERED], view={"switch_cost_s": 2.0}))
    service.feed(4, {A: {1: RIGHT}, B: {}})
    assert len(events) == 1
    service.close()


def floor_site(unit: str | None) -> Config:
    cameras = [
        {"id": camera, "source": "x.mp4", "ground": IDENTITY, "ground_unit": unit} for camera in CAMERAS
    ]
    return small_config(cameras)


def decided(service: FedService, boxes: dict[str, dict[int, Box]]) -> GopDecision:
    decisions: list[GopDecision] = []
    put = service.decision_state.put

    def keep(decision: GopDecision) -> GopChoices:
        decisions.append(decision)
        return put(decision)

    service.decision_state.put = keep  # type: ignore[method-assign]
    for epoch in range(3):
        service.feed(epoch, {camera: boxes.get(camera, {}) for camera in CAMERAS})
    service.close()
    return decisions[0]


def test_positions_on_the_floor_are_the_feet_seen_by_usable_cameras() -> None:
    config = floor_site("m")
    service = FedService(config)
    service.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    service.connect_cameras(*CAMERAS)
    decision = decided(service, {A: {1: LEFT}, B: {1: RIGHT}})
    letterboxes = service.decider.people.letterboxes

    def place(*usable: str) -> tuple[float, float]:
        frames = list(people_of_frames(decision, usable, letterboxes, ()))
        assert [frame.pulse for frame in frames] == list(
            range(decision.first, decision.first + decision.frames)
        )
        assert frames[0].cameras == {1: frozenset(usable)}
        return frames[0].floor[1]

    depth = 1.0 + 0.001 * 28.0
    np.testing.assert_allclose(place(A), (5.0 / depth, 28.0 / depth))
    np.testing.assert_allclose(place(B), (53.0 / depth, 28.0 / depth))
    assert place(A)[0] < place(A, B)[0] < place(B)[0], "the mean of both"
    assert list(people_of_frames(decision, (), letterboxes, ()))[0].floor == {}  # noqa: RUF015


def test_boxes_whose_feet_are_cut_off_have_no_place() -> None:
    service = FedService(floor_site("m"))
    service.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    service.connect_cameras(*CAMERAS)
    decision = decided(service, {A: {1: (2.0, 10.0, 8.0, float(HEIGHT))}})
    (frame, *_) = people_of_frames(decision, {A}, service.decider.people.letterboxes, ())
    assert frame.floor == {}
    assert frame.pictures[A] == {1: (5.0, float(HEIGHT))}


@pytest.mark.parametrize(("unit", "scale"), [("m", 1.0), ("cm", 100.0), (None, 1.0)])
def test_zones_on_the_floor_are_in_meters(unit: str | None, scale: float) -> None:
    content: dict[str, Any] = {
        "site": {"width": WIDTH, "height": HEIGHT},
        "cameras": [{"id": "c0", "source": "x.mp4", "ground": IDENTITY, "ground_unit": unit}],
        "zones": [{"id": "till", "area": [[0, 0], [1, 0], [1, 1]]}],
    }

    evaluator = create_evaluator(build_config(content, where="x", folder=Path()))
    assert evaluator._zones["till"].depth((scale * 0.9, scale * 0.1)) == pytest.approx(0.1 * scale)
    assert evaluator._zones["till"].margin == pytest.approx(0.2 * scale)
