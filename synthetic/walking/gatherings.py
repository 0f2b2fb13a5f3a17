"""Rounds of a gathering crowd: groups that meet, stand together and part."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import scipy

from synthetic.cameras.pinhole import Floats
from synthetic.walking.choreographed_crowd import (
    BEFORE,
    ROUND,
    RoundPath,
    avoid_collisions,
    crowding_cost,
    heading_to,
    straight_path,
)

_PACE = (0.95, 1.3)  # meters per second
_SLOWEST = 0.7  # meters per second: slower people stand and wait instead
_TALK = (1.0, 4.0)  # seconds that a complete group stands together
_LINGER = 0.8  # seconds between the first and the last to leave
_SIZES = (1, 2, 3, 4)  # of groups
_ODDS = (0.12, 0.5, 0.26, 0.12)
_SHOULDERS = 0.48  # meters from one to the next in a group: shoulders touch
_ASIDE = 0.5  # meters in front of a pair: the point that both face
_KEEP_GROUP = 0.46  # meters between two who stand together
_KEEP_OTHERS = 0.75  # least meters between others, if there is room
_CANDIDATES = 40
_DETOUR = 0.65  # share of the walks with a detour
_DAWDLE = 0.5  # longest delay of a person's start, seconds
_SHORTLIST = 5  # best plans, for which collisions are avoided before the final choice
_HURRY = 4.0  # cost per second of lateness
_PAUSE = 1.5  # longest stop of a single person, seconds

Area: TypeAlias = tuple[float, float, float, float]  # west, south, east and north bound, meters


class Gatherings:
    """Rounds in which people meet, stand together and part; at the end of each all are apart.

    Args:
        area: the floor area they use.
        people: number of people.
        seed: the random seed.
    """

    def __init__(self, area: Area, people: int, seed: int) -> None:
        self._area, self._people, self._seed = area, people, seed

    def paths(self, number: int) -> list[RoundPath]:
        """Return all paths of a round, from its initial positions to those of the next round."""
        rng = np.random.default_rng([self._seed, 0x6A74, number + BEFORE])
        return plan_gathering(rng, self._places(number), self._places(number + 1), self._area)

    def _places(self, number: int) -> Floats:
        """Return all positions at the beginning of a round: ``(P, 2)``."""
        rng = np.random.default_rng([self._seed, 0x91A5, number + BEFORE])
        return draw_spread_places(rng, self._people, self._area)


def draw_spread_places(rng: np.random.Generator, count: int, area: Area) -> Floats:
    """Draw random positions ``(count, 2)`` far apart: the best of several draws."""
    west, south, east, north = area
    drawn = rng.uniform((west, south), (east, north), (_CANDIDATES, count, 2))
    gaps = np.linalg.norm(drawn[:, :, None] - drawn[:, None], axis=3)
    gaps[:, np.arange(count), np.arange(count)] = np.inf
    best: Floats = drawn[int(gaps.min(axis=(1, 2), initial=np.inf).argmax())]
    return best


def plan_gathering(rng: np.random.Generator, starts: Floats, ends: Floats, area: Area) -> list[RoundPath]:
    """Plan paths from the starts ``(P, 2)`` to groups and on to the ends ``(P, 2)``.

    Returns the best of several random plans by collisions and lateness.
    """
    if not len(starts):
        return []
    plans = sorted(
        (_propose(rng, starts, ends, area) for _ in range(_CANDIDATES)), key=lambda plan: plan.penalty
    )
    bent = [_bend(plan) for plan in plans[:_SHORTLIST]]
    return list(min(bent, key=lambda plan: plan.penalty).paths)


@dataclass(frozen=True, slots=True)
class _Plan:
    """A candidate for a round."""

    paths: tuple[RoundPath, ...]
    keep: Floats  # (P, P) meters to keep between each pair
    hurry: float  # total lateness in seconds
    penalty: float


def _propose(rng: np.random.Generator, starts: Floats, ends: Floats, area: Area) -> _Plan:
    groups = _groups(rng, len(starts))
    paths, hurry = _lead(rng, groups, starts, ends, area)
    keep = _keep(groups, len(starts))
    return _Plan(tuple(paths), keep, hurry, _HURRY * hurry + crowding_cost(paths, keep))


def _bend(plan: _Plan) -> _Plan:
    paths = avoid_collisions(plan.paths, plan.keep)
    return replace(plan, paths=paths, penalty=_HURRY * plan.hurry + crowding_cost(paths, plan.keep))


def _groups(rng: np.random.Generator, count: int) -> list[list[int]]:
    """Split the crowd into random groups, at least one of them with two people or more."""
    while True:
        order, groups = rng.permutation(count).tolist(), []
        while order:
            size = int(rng.choice(_SIZES, p=_ODDS))
            groups.append(order[:size])
            order = order[size:]
        if count < 2 or any(len(group) > 1 for group in groups):  # noqa: PLR2004 — no meeting possible
            return groups


def _lead(
    rng: np.random.Generator, groups: list[list[int]], starts: Floats, ends: Floats, area: Area
) -> tuple[list[RoundPath], float]:
    west, south, east, north = area
    paths: dict[int, RoundPath] = {}
    hurry = 0.0
    for group in groups:
        size = len(group)
        middle = rng.uniform((west + 0.4, south + 0.4), (east - 0.4, north - 0.4))
        slots, look = _slots(middle, size, float(rng.uniform(0, 2 * np.pi)))
        steps = np.linalg.norm(starts[group][:, None] - slots[None], axis=2)
        assigned = scipy.optimize.linear_sum_assignment(steps)[1]
        trips = [
            _trip(rng, area, float(rng.uniform(*_PACE)), starts[walker], slots[slot], ends[walker])
            for walker, slot in zip(group, assigned.tolist(), strict=True)
        ]
        begin = rng.uniform(0.0, _DAWDLE, size)
        arrive = begin + [trip.there for trip in trips]
        talk = float(rng.uniform(*_TALK)) if size > 1 else float(rng.uniform(0.0, _PAUSE))
        leave = arrive.max() + talk + rng.uniform(0.0, _LINGER, size)
        for index, walker in enumerate(group):
            hurry += max(leave[index] + trips[index].back - ROUND, 0.0)
            paths[walker] = _path(trips[index], begin[index], min(leave[index], ROUND - 0.5), look)
    return [paths[walker] for walker in range(len(starts))], hurry


@dataclass(frozen=True, slots=True)
class _Trip:
    """A walk to a group and on, without the time spent there."""

    places: Floats  # (K, 2) meters
    slot: int  # index of the one in the group
    pace: float  # meters per second

    @property
    def spans(self) -> Floats:
        """The seconds ``(K - 1,)`` from each place to the next."""
        spans: Floats = np.linalg.norm(np.diff(self.places, axis=0), axis=1) / self.pace
        return spans

    @property
    def there(self) -> float:
        """Seconds to the group."""
        return float(self.spans[: self.slot].sum())

    @property
    def back(self) -> float:
        """Seconds from the group to the end."""
        return float(self.spans[self.slot :].sum())


def _trip(
    rng: np.random.Generator, area: Area, pace: float, start: Floats, slot: Floats, end: Floats
) -> _Trip:
    """Draw a trip to a slot and on to the end; each part may have a detour."""
    west, south, east, north = area
    places = [start]
    for goal in (slot, end):
        if rng.random() < _DETOUR:
            places.append(rng.uniform((west, south), (east, north)))
        places.append(goal)
        if goal is slot:
            at = len(places) - 1
    return _Trip(np.array(places), at, pace)


def _path(trip: _Trip, begin: float, leave: float, look: Floats) -> RoundPath:
    """Return a trip's timed path; a walker who would arrive early walks more slowly."""
    spans = trip.spans
    spans[trip.slot :] *= min((ROUND - leave) / trip.back, trip.pace / _SLOWEST)
    there = begin + np.cumsum([0.0, *spans[: trip.slot]])
    back = leave + np.cumsum([0.0, *spans[trip.slot :]])
    places = np.concatenate([trip.places[:1], trip.places[: trip.slot + 1], trip.places[trip.slot :]])
    steps = np.diff(trip.places, axis=0)
    facing = np.arctan2(steps[:, 1], steps[:, 0])
    meet = heading_to(trip.places[trip.slot], look)
    facing = np.array([facing[0], *facing[: trip.slot], meet, *facing[trip.slot :], facing[-1], facing[-1]])
    times = np.array([0.0, *there, *back, ROUND])
    return straight_path(times, np.concatenate([places, trip.places[-1:]]), facing)


def _slots(middle: Floats, size: int, turn: float) -> tuple[Floats, Floats]:
    """Return the positions ``(size, 2)`` around a group's center, and the point ``(2,)`` that it faces."""
    if size == 1:
        return middle[None], middle + np.array([np.cos(turn), np.sin(turn)])
    angles = turn + 2 * np.pi * np.arange(size) / size
    radius = _SHOULDERS / 2 / np.sin(np.pi / size)
    slots = middle + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    # Two stand side by side, half facing each other; more stand in a ring.
    ahead = _ASIDE * np.array([-np.sin(turn), np.cos(turn)]) if size == 2 else np.zeros(2)  # noqa: PLR2004
    return slots, middle + ahead


def _keep(groups: list[list[int]], count: int) -> Floats:
    """Return the distances to keep between each pair: ``(count, count)`` meters."""
    keep = np.full((count, count), _KEEP_OTHERS)
    for group in groups:
        keep[np.ix_(group, group)] = _KEEP_GROUP
    return keep
