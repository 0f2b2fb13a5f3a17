"""Silhouettes that stand still and are hardly ever confirmed by the network are hardly people."""

from __future__ import annotations

import numpy as np

from tracking.boxes import Floats
from tracking.detectors.fused.still_silhouettes import StillSilhouettes

PLACE = np.array([10.0, 10.0, 20.0, 40.0])
RUN_S = 0.2


def observed(
    silhouettes: StillSilhouettes, seconds: float, box: Floats = PLACE, *, confirmed: bool = False
) -> None:
    for _ in range(round(seconds / RUN_S)):
        silhouettes.update(box[None], np.array([confirmed]), RUN_S, 1.0)


def penalty(silhouettes: StillSilhouettes, box: Floats = PLACE) -> float:
    return float(silhouettes.penalties(box[None])[0])


def test_the_longer_it_stands_unconfirmed_the_less_it_is_a_person() -> None:
    silhouettes = StillSilhouettes()
    penalties = []
    for _ in range(12):
        observed(silhouettes, 2.0)
        penalties.append(penalty(silhouettes))
    assert 0.0 < penalties[0] < penalties[1] < penalties[4]
    assert penalties[-1] == penalties[-2], "there is a limit"
    assert penalty(silhouettes, PLACE + 12.0) == 0.0


def test_a_person_whom_the_network_finds_now_and_then_stays_one() -> None:
    silhouettes = StillSilhouettes()
    for _ in range(50):
        observed(silhouettes, 0.6)
        observed(silhouettes, RUN_S, confirmed=True)
        assert penalty(silhouettes) < 0.5


def test_a_person_found_for_long_may_be_missed_for_some_seconds() -> None:
    silhouettes = StillSilhouettes()
    observed(silhouettes, 5.0, confirmed=True)
    observed(silhouettes, 8.0)
    assert penalty(silhouettes) == 0.0
    observed(silhouettes, 8.0)
    assert penalty(silhouettes) > 2.0


def test_somebody_who_passes_a_thing_confirms_it_for_a_moment_only() -> None:
    silhouettes = StillSilhouettes()
    observed(silhouettes, 10.0)
    before = penalty(silhouettes)
    observed(silhouettes, 0.4, confirmed=True)
    observed(silhouettes, 2.0)
    assert penalty(silhouettes) >= before


def test_parts_of_a_doubted_thing_are_doubted_as_much() -> None:
    silhouettes = StillSilhouettes()
    observed(silhouettes, 10.0)
    part, beside = np.array([10.0, 10.0, 16.0, 24.0]), np.array([15.0, 10.0, 25.0, 40.0])
    assert penalty(silhouettes, part) == penalty(silhouettes)
    assert penalty(silhouettes, beside) == 0.0, "somebody who stands beside it is not"


def test_who_moves_is_new_at_every_place() -> None:
    silhouettes = StillSilhouettes()
    for step in range(100):
        box = PLACE + np.array([step, 0.0, step, 0.0])
        observed(silhouettes, RUN_S, box)
        assert penalty(silhouettes, box) < 0.6


def test_what_was_not_seen_for_some_seconds_is_new() -> None:
    silhouettes = StillSilhouettes()
    observed(silhouettes, 10.0)
    for _ in range(round(9.0 / RUN_S)):
        silhouettes.update(np.empty((0, 4)), np.empty(0, dtype=np.bool_), RUN_S, 1.0)
    assert penalty(silhouettes) > 0.0, "what flickers comes back"
    for _ in range(round(2.0 / RUN_S)):
        silhouettes.update(np.empty((0, 4)), np.empty(0, dtype=np.bool_), RUN_S, 1.0)
    assert penalty(silhouettes) == 0.0


def test_where_the_network_finds_nobody_silhouettes_are_forgotten_and_not_doubted() -> None:
    silhouettes = StillSilhouettes()
    for step in range(500):
        box = PLACE + np.array([step, 0.0, step, 0.0])
        silhouettes.update(np.stack([PLACE, box]), np.zeros(2, dtype=np.bool_), RUN_S, 0.0)
    assert penalty(silhouettes) == 0.0
    assert len(silhouettes._known) < 30
