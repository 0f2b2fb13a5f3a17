"""Views for viewers who choose another delay, and their regret."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import NO_CAMERA, NO_VIEW_COST
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    GOP,
    LARGE,
    SMALL,
    TrackNumbers,
    camera_tracks,
    epoch_of,
    small_config,
)
from server.messaging.messages import Box
from server.service.view_selection.decider import GopDecision, ViewDecider
from server.service.view_selection.delay_modes import DelayMode, FinalCosts, ModeDecision
from server.service.view_selection.regret import RegretMeter

A, B = CAMERAS
Seen = Mapping[str, Mapping[int, Box | None]]
IN_A: Seen = {A: {1: LARGE}, B: {1: SMALL}}
IN_B: Seen = {A: {1: SMALL}, B: {1: LARGE}}
SMOOTH_S = 6 * GOP / FPS


def decided(
    story: Sequence[Seen], end: int | None = None, **view: Any
) -> tuple[list[GopDecision], list[ModeDecision], ViewDecider]:
    """Feed a scripted scene epoch by epoch; every epoch is a GOP."""
    config = small_config(view={"smooth_lookahead_s": SMOOTH_S, **view})
    decider = ViewDecider(config, dict.fromkeys(CAMERAS), lambda *_: True)
    decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    balanced: list[GopDecision] = []
    others: list[ModeDecision] = []
    for number, seen in enumerate(story):
        words = (camera_tracks(camera, number, boxes) for camera, boxes in seen.items())
        balanced += decider.step(epoch_of(number, *words))
        others += decider.modes.take()
    if end is not None:
        balanced += decider.finish(end)
        others += decider.modes.take()
    return balanced, others, decider


def shown(decisions: Sequence[ModeDecision], mode: DelayMode, number: int = 1) -> dict[int, str | None]:
    return {
        decision.first // GOP: decision.cameras[number]
        for decision in decisions
        if decision.mode is mode and number in decision.cameras
    }


def test_live_views_are_selected_before_their_frames_by_what_is_known_then() -> None:
    _, others, _ = decided([IN_A] * 4 + [IN_B] * 4)
    live = shown(others, DelayMode.LIVE)
    # An epoch is known .2 s (a GOP) before the GOP that it decides.
    assert [live[gop] for gop in range(1, 9)] == [A, A, A, A, A, B, B, B]
    assert all(decision.first > 0 for decision in others if decision.mode is DelayMode.LIVE)


@pytest.mark.parametrize("lag_s", [0.0, 0.2, 0.4])
def test_live_views_use_no_frame_within_the_lag(lag_s: float) -> None:
    lag = round(lag_s * FPS / GOP)
    _, others, _ = decided([IN_A] * 4 + [IN_B] * 6, live_lag_s=lag_s)
    live = shown(others, DelayMode.LIVE)
    assert next(gop for gop, camera in live.items() if camera == B) == 4 + 1 + lag


def test_live_cuts_only_where_it_pays_within_the_horizon() -> None:
    larger: Box = (20.0, 4.0, 36.5, 44.0)
    story = [{A: {1: LARGE}, B: {1: SMALL}}] * 2 + [{A: {1: LARGE}, B: {1: larger}}] * 6
    for horizon_s, expected in ((0.5, A), (60.0, B)):
        _, others, _ = decided(story, live_horizon_s=horizon_s)
        assert shown(others, DelayMode.LIVE)[8] == expected


def test_smooth_views_are_those_of_a_longer_look_ahead() -> None:
    rng = np.random.default_rng(1)
    story = [IN_A if part else IN_B for part in rng.integers(0, 2, 12).repeat(rng.integers(1, 5, 12))]
    end = len(story) * GOP - 1
    balanced, others, _ = decided(story, end)
    smooth = shown(others, DelayMode.SMOOTH)
    assert list(smooth) == [decision.first // GOP for decision in balanced], "each GOP once, in order"
    longer, _, _ = decided(story, end, lookahead_s=SMOOTH_S)
    # The balanced look-ahead's last frames stand for more than those of the longer one.
    agreed = [smooth[decision.first // GOP] == decision.choices[0].camera for decision in longer]
    assert np.mean(agreed) > 0.9


def test_a_brief_better_view_is_skipped_by_smooth_though_live_takes_it() -> None:
    story = [IN_A] * 8 + [IN_B] * 2 + [IN_A] * 8
    _, others, _ = decided(story, len(story) * GOP - 1, switch_cost_s=0.25)
    assert set(shown(others, DelayMode.SMOOTH).values()) == {A}
    assert B in shown(others, DelayMode.LIVE).values()


def test_somebody_new_costs_nobody_a_cut() -> None:
    alone: Seen = {A: {1: LARGE}, B: {1: SMALL}}
    both: Seen = {A: {1: LARGE}, B: {1: SMALL, 2: LARGE}}
    _, others, _ = decided([alone] * 8 + [both] * 8, 16 * GOP - 1)
    smooth = shown(others, DelayMode.SMOOTH, 2)
    assert set(smooth.values()) == {B}
    assert not [cut for decision in others for cut in decision.cuts if cut[0] == 2]


def test_a_longer_look_ahead_than_smooth_is_smooth() -> None:
    balanced, others, _ = decided([IN_A] * 4 + [IN_B] * 8, smooth_lookahead_s=0.04)
    assert shown(others, DelayMode.SMOOTH) == {
        decision.first // GOP: decision.choices[0].camera for decision in balanced
    }


def test_after_skipped_epochs_all_delays_continue() -> None:
    config = small_config(view={"smooth_lookahead_s": SMOOTH_S})
    decider = ViewDecider(config, dict.fromkeys(CAMERAS), lambda *_: True)
    decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    others: list[ModeDecision] = []
    for number in [*range(8), *range(30, 42)]:
        epoch = epoch_of(number, camera_tracks(A, number, {1: LARGE}), camera_tracks(B, number, {1: SMALL}))
        decider.step(replace(epoch, skipped=22 if number == 30 else 0))
        others += decider.modes.take()
    for mode in (DelayMode.LIVE, DelayMode.SMOOTH):
        firsts = [decision.first for decision in others if decision.mode is mode]
        assert firsts == sorted(set(firsts))
        assert max(firsts) > 32 * GOP


def costs(first: int, cost: list[list[float]]) -> FinalCosts:
    array = np.array(cost, dtype=np.float64).T
    return FinalCosts(first, GOP, np.arange(1, array.shape[1] + 1), array, None)


@settings(max_examples=40)
@given(
    st.lists(
        st.lists(st.sampled_from([0.0, 1.0, 2.5, 4.0, np.inf]), min_size=2, max_size=2),
        min_size=1,
        max_size=6,
    ),
    st.floats(0.0, 5.0),
    st.data(),
)
def test_regret_is_the_cost_beyond_the_best_of_all_sequences(
    gops: list[list[float]], switch_cost: float, data: st.DataObject
) -> None:
    views = [data.draw(st.sampled_from([0, 1, NO_CAMERA])) for _ in gops]
    seen = [any(cost < NO_VIEW_COST * GOP for cost in gop) for gop in gops]
    if not all(seen):  # GOPs in which nobody sees the person do not count
        return
    meter = RegretMeter(FPS, GOP)
    previous = NO_CAMERA
    for number, (gop, view) in enumerate(zip(gops, views, strict=True)):
        decision = ModeDecision(
            DelayMode.LIVE, number * GOP, GOP, np.array([1]), np.array([view]), np.array([previous]), CAMERAS
        )
        meter.add_decision(decision, switch_cost)
        meter.add_costs(costs(number * GOP, [gop]), switch_cost)
        previous = view if view != NO_CAMERA else previous

    def total(sequence: Sequence[int]) -> float:
        spent = [
            NO_VIEW_COST * GOP if view == NO_CAMERA or np.isinf(gop[view]) else gop[view]
            for gop, view in zip(gops, sequence, strict=True)
        ]
        cameras = [view for view in sequence if view != NO_CAMERA]
        return sum(spent) + switch_cost * sum(one != other for one, other in pairwise(cameras))

    possible = [
        sequence
        for sequence in product((0, 1), repeat=len(gops))
        if all(np.isfinite(gop[view]) for gop, view in zip(gops, sequence, strict=True))
    ]
    score = meter.score(DelayMode.LIVE)
    assert score is not None
    expected = max(total(views) - min(map(total, possible)), 0.0)
    assert score.regret_s == pytest.approx(60.0 * expected / (GOP * len(gops)), abs=1e-9)


def test_every_delay_has_a_score_and_a_longer_look_ahead_a_lower_regret() -> None:
    rng = np.random.default_rng(3)
    story = [IN_A if part else IN_B for part in rng.integers(0, 2, 30).repeat(rng.integers(1, 6, 30))]
    _, _, decider = decided(story, len(story) * GOP - 1, switch_cost_s=0.2)
    scores = [decider.modes.score(mode) for mode in DelayMode]
    regrets = [score.regret_s for score in scores if score is not None]
    assert len(regrets) == 3
    live, balanced, smooth = regrets
    assert live > balanced >= smooth >= 0.0
