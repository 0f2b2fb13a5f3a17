"""A change of the look-ahead at run time: no stream has a gap, no GOP is decided too early."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.service.fed_site import A, B, ServedSite
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    GOP,
    LARGE,
    SMALL,
    STRIDE,
    FedService,
    TrackNumbers,
    camera_tracks,
    epoch_of,
    joined_fragments,
    small_config,
)
from server.config.sections import ViewSettings
from server.http.access.csrf import CSRF_HEADER
from server.service.streaming.subscriber_queue import Chunk
from server.service.view_selection.decider import GopDecision, ViewDecider
from server.system.errors import UserError

EPOCHS = 8  # as many as there are pictures of
MINE = {CSRF_HEADER: "1"}
Changes = Mapping[int, int]
"""The look-ahead from an epoch on, by epoch."""
CHANGED = st.dictionaries(st.integers(0, 29), st.integers(GOP, 40), max_size=6)


def with_lookahead(view: ViewSettings, frames: int) -> ViewSettings:
    return view.model_copy(update={"lookahead_s": frames / FPS})


@settings(deadline=None, max_examples=15)
@given(CHANGED, st.sampled_from([5, 10]), st.sampled_from([0.0, 0.6]))
def test_every_gop_is_decided_once_in_order_with_known_frames(
    changes: Changes, gop: int, min_shot_s: float
) -> None:
    config = small_config(
        encode={"gop_s": gop / FPS}, view={"lookahead_s": 20 / FPS, "min_shot_s": min_shot_s}
    )
    decider = ViewDecider(config, dict.fromkeys(CAMERAS), lambda *_: True)
    decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    decided: list[GopDecision] = []
    for number in range(45):
        if number in changes:
            decider.apply_live_view_settings(with_lookahead(config.view, max(gop, changes[number])))
        one, other = (SMALL, LARGE) if number // 3 % 2 else (LARGE, SMALL)
        epoch = epoch_of(number, camera_tracks(A, number, {1: one}), camera_tracks(B, number, {1: other}))
        new = decider.step(epoch)
        assert len(new) <= -(-STRIDE // gop) + 1, "viewers lose nothing"
        for decision in new:
            assert decision.reasons.of(1).frames == config.lookahead_of(decider.view)
            assert decision.first + config.lookahead_of(decider.view) - 1 <= epoch.last
        decided += new
    assert [decision.first for decision in decided] == [gop * n for n in range(len(decided))]
    # Some epochs after the last change the streams are as near to the cameras as they can be.
    ahead = epoch.last + 1 - (decided[-1].first + gop)
    lookahead = config.lookahead_of(decider.view)
    assert lookahead - gop <= ahead < lookahead


def test_after_a_change_settles_views_are_selected_as_if_it_had_always_applied() -> None:
    def decisions_after(*changes: tuple[int, int]) -> list[GopDecision]:
        config = small_config(view={"lookahead_s": 20 / FPS})
        decider = ViewDecider(config, dict.fromkeys(CAMERAS), lambda *_: True)
        decider.people._registry = TrackNumbers()  # type: ignore[assignment]
        decided = []
        for number in range(30):
            for epoch, frames in changes:
                if epoch == number:
                    decider.apply_live_view_settings(with_lookahead(config.view, frames))
            boxes = {A: {1: LARGE if number < 20 else SMALL}, B: {1: SMALL if number < 20 else LARGE}}
            decided += decider.step(
                epoch_of(number, *(camera_tracks(camera, number, boxes[camera]) for camera in CAMERAS))
            )
        return decided

    for changes in ([(3, 35), (8, 20)], [(3, 10), (9, 20)]):
        assert decisions_after(*changes) == decisions_after()


@settings(deadline=None, max_examples=20)
@given(st.dictionaries(st.integers(0, EPOCHS - 1), st.integers(GOP, 30), max_size=4))
def test_streams_are_the_selected_cameras_gops_without_a_gap(changes: Changes) -> None:
    service = FedService(small_config())
    service.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    service.connect_cameras(*CAMERAS)
    shown: list[str | None] = []
    service.on_decision.append(lambda choices: shown.append(choices.choices.get(1)))
    got: list[bytes] = []

    def take(piece: Chunk) -> bool:
        got.append(piece.data)
        return True

    viewer = None
    for epoch in range(EPOCHS):
        if epoch in changes:
            service.apply_live_view_settings(with_lookahead(service.config.view, changes[epoch]))
        one, other = (SMALL, LARGE) if epoch // 3 % 2 else (LARGE, SMALL)
        service.feed(epoch, {A: {1: one}, B: {1: other}})
        if viewer is None and 1 in service.splicer.persons:
            viewer = service.splicer.persons[1].subscribe()
            change = len(shown) - 1
            got += [chunk.data for chunk in viewer._queue]
            viewer._queue.clear()
            viewer.direct_send = take
    if viewer is not None:
        assert viewer.lost_gops == 0
        names = [camera or "" for camera in shown[change:]]
        assert got == [
            joined_fragments(service.frame_buffers[name], (change + n) * GOP, GOP)
            for n, name in enumerate(names)
        ]
    service.close()


@pytest.mark.parametrize(
    ("seconds", "error"),
    [
        (0.16, "view.lookahead_s: is 0.16 s but must be at least 0.2 (encode.gop_s + "),
        (400.0, "view.lookahead_s: is 400 s but can be at most "),
        (0, "to try out: view.lookahead_s: Input should be greater than 0"),
    ],
)
async def test_an_invalid_look_ahead_is_refused_with_the_limits(
    site_with_people: ServedSite, seconds: float, error: str
) -> None:
    request = {"lookahead_s": seconds}
    async with site_with_people.session.put(
        "/api/operator/view_selection", headers=MINE, json=request
    ) as answer:
        assert answer.status == 400
        refusal = (await answer.json())["error"]
    assert refusal.startswith(error)
    assert "\n" not in refusal
    assert site_with_people.service.decider.view == site_with_people.service.config.view


async def test_the_api_reports_the_look_ahead_in_force(site_with_people: ServedSite) -> None:
    most = (await site_with_people.get_json("/api/operator/view_selection"))["max_lookahead_s"]
    for seconds in (most, 0.2):
        request: dict[str, Any] = {"lookahead_s": seconds}
        async with site_with_people.session.put(
            "/api/operator/view_selection", headers=MINE, json=request
        ) as answer:
            decisions_after = await answer.json()
        assert decisions_after["values"]["lookahead_s"] == seconds
        assert f"lookahead_s: {seconds}\n" in decisions_after["lines"]
        assert (await site_with_people.get_json("/api/site"))["lookahead_s"] == seconds


def test_frame_buffers_cover_the_longest_look_ahead() -> None:
    for view in ({}, {"buffer_s": 1.0}, {"buffer_s": 60.0}, {"lookahead_s": 8.0}):
        service = FedService(small_config(view=view))
        config, fps = service.config, service.config.site.fps
        buffered = service.frame_buffers[A]._max_frames
        late = round(config.view.late_after_s * fps) + round(config.track.backlog_s * fps)
        assert service.max_lookahead >= config.lookahead
        assert service.max_lookahead + late + STRIDE + GOP <= buffered
        with pytest.raises(UserError):
            service.apply_live_view_settings(with_lookahead(config.view, service.max_lookahead + 1))
        service.close()
