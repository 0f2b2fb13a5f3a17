"""One round of a company: who meets whom, where they stand together, and where they part to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import scipy

from synthetic.cameras.pinhole import Floats
from synthetic.walking.paths import BEFORE, ROUND, Way, bend, crowding, straight_way, towards

_PACE = (0.95, 1.3)  # metres per second
_SLOWEST = 0.7  # metres per second: who would be slower stands and waits
_TALK = (1.0, 4.0)  # seconds that all of a group stand together
_LINGER = 0.8  # seconds between the first and the last to leave
_SIZES = (1, 2, 3, 4)  # of groups
_ODDS = (0.12, 0.5, 0.26, 0.12)
_SHOULDERS = 0.48  # metres from one to the next in a group: shoulders touch
_ASIDE = 0.5  # metres before a pair that both look at
_KEEP_GROUP = 0.46  # metres between two who stand together
_KEEP_OTHERS = 0.75  # metres between others, at least, wherever there is room
_CANDIDATES = 40
_DETOUR = 0.65  # of the ways lead by somewhere else
_DAWDLE = 0.5  # seconds, at most, before one sets out
_SHORTLIST = 5  # plans in which people are let give way, to see which is the best then
_HURRY = 4.0  # how much a second too late counts
_PAUSE = 1.5  # seconds: the longest that somebody alone stands

Area: TypeAlias = tuple[float, float, float, float]  # west, south, east and north bound, metres


class Gatherings:
    """The rounds of people who meet, stand together and part: at the end of each everybody is apart.

    Args:
        area: where they go.
        people: how many.
        seed: of everything random.
    """

    def __init__(self, area: Area, people: int, seed: int) -> None:
        self._area, self._people, self._seed = area, people, seed

    def ways(self, number: int) -> list[Way]:
        """Plan a round from the places where it begins to those where the next one does."""
        rng = np.random.default_rng([self._seed, 0x6A74, number + BEFORE])
        return gather(rng, self._places(number), self._places(number + 1), self._area)

    def _places(self, number: int) -> Floats:
        """Say where everybody is when a round begins: ``(P, 2)``."""
        rng = np.random.default_rng([self._seed, 0x91A5, number + BEFORE])
        return apart(rng, self._people, self._area)


def apart(rng: np.random.Generator, count: int, area: Area) -> Floats:
    """Draw places ``(count, 2)`` that lie apart: the best of some draws."""
    west, south, east, north = area
    drawn = rng.uniform((west, south), (east, north), (_CANDIDATES, count, 2))
    gaps = np.linalg.norm(drawn[:, :, None] - drawn[:, None], axis=3)
    gaps[:, np.arange(count), np.arange(count)] = np.inf
    best: Floats = drawn[int(gaps.min(axis=(1, 2), initial=np.inf).argmax())]
    return best


def gather(rng: np.random.Generator, starts: Floats, ends: Floats, area: Area) -> list[Way]:
    """Lead everybody from their start ``(P, 2)`` to a group and on to their end ``(P, 2)``.

    Of several plans it is the one in which people keep out of each other's way and nobody has to hurry.
    """
    if not len(starts):
        return []
    plans = sorted(
        (_propose(rng, starts, ends, area) for _ in range(_CANDIDATES)), key=lambda plan: plan.fault
    )
    bent = [_bend(plan) for plan in plans[:_SHORTLIST]]
    return list(min(bent, key=lambda plan: plan.fault).ways)


@dataclass(frozen=True, slots=True)
class _Plan:
    """A round as it might be."""

    ways: tuple[Way, ...]
    keep: Floats  # (P, P) metres that any two should keep apart
    hurry: float  # seconds by which people would come too late
    fault: float


def _propose(rng: np.random.Generator, starts: Floats, ends: Floats, area: Area) -> _Plan:
    groups = _groups(rng, len(starts))
    ways, hurry = _lead(rng, groups, starts, ends, area)
    keep = _keep(groups, len(starts))
    return _Plan(tuple(ways), keep, hurry, _HURRY * hurry + crowding(ways, keep))


def _bend(plan: _Plan) -> _Plan:
    ways = bend(plan.ways, plan.keep)
    return replace(plan, ways=ways, fault=_HURRY * plan.hurry + crowding(ways, plan.keep))


def _groups(rng: np.random.Generator, count: int) -> list[list[int]]:
    """Part the company into groups; as long as there are two people, somebody meets."""
    while True:
        order, groups = rng.permutation(count).tolist(), []
        while order:
            size = int(rng.choice(_SIZES, p=_ODDS))
            groups.append(order[:size])
            order = order[size:]
        if count < 2 or any(len(group) > 1 for group in groups):  # noqa: PLR2004 — a meeting takes two
            return groups


def _lead(
    rng: np.random.Generator, groups: list[list[int]], starts: Floats, ends: Floats, area: Area
) -> tuple[list[Way], float]:
    west, south, east, north = area
    ways: dict[int, Way] = {}
    hurry = 0.0
    for group in groups:
        size = len(group)
        middle = rng.uniform((west + 0.4, south + 0.4), (east - 0.4, north - 0.4))
        slots, look = _slots(middle, size, float(rng.uniform(0, 2 * np.pi)))
        steps = np.linalg.norm(starts[group][:, None] - slots[None], axis=2)
        taken = scipy.optimize.linear_sum_assignment(steps)[1]
        trips = [
            _trip(rng, area, float(rng.uniform(*_PACE)), starts[walker], slots[slot], ends[walker])
            for walker, slot in zip(group, taken.tolist(), strict=True)
        ]
        begin = rng.uniform(0.0, _DAWDLE, size)
        arrive = begin + [trip.there for trip in trips]
        talk = float(rng.uniform(*_TALK)) if size > 1 else float(rng.uniform(0.0, _PAUSE))
        leave = arrive.max() + talk + rng.uniform(0.0, _LINGER, size)
        for index, walker in enumerate(group):
            hurry += max(leave[index] + trips[index].back - ROUND, 0.0)
            ways[walker] = _way(trips[index], begin[index], min(leave[index], ROUND - 0.5), look)
    return [ways[walker] for walker in range(len(starts))], hurry


@dataclass(frozen=True, slots=True)
class _Trip:
    """A walk to a group and back, without the time spent there."""

    places: Floats  # (K, 2) metres
    slot: int  # which of them is in the group
    pace: float  # metres per second

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
    """Walk to a slot and on to the end; on either way perhaps by a place that is a detour."""
    west, south, east, north = area
    places = [start]
    for goal in (slot, end):
        if rng.random() < _DETOUR:
            places.append(rng.uniform((west, south), (east, north)))
        places.append(goal)
        if goal is slot:
            at = len(places) - 1
    return _Trip(np.array(places), at, pace)


def _way(trip: _Trip, begin: float, leave: float, look: Floats) -> Way:
    """Time a trip: who would be at its end too early walks more slowly on the way there."""
    spans = trip.spans
    spans[trip.slot :] *= min((ROUND - leave) / trip.back, trip.pace / _SLOWEST)
    there = begin + np.cumsum([0.0, *spans[: trip.slot]])
    back = leave + np.cumsum([0.0, *spans[trip.slot :]])
    places = np.concatenate([trip.places[:1], trip.places[: trip.slot + 1], trip.places[trip.slot :]])
    steps = np.diff(trip.places, axis=0)
    faces = np.arctan2(steps[:, 1], steps[:, 0])
    meet = towards(trip.places[trip.slot], look)
    faces = np.array([faces[0], *faces[: trip.slot], meet, *faces[trip.slot :], faces[-1], faces[-1]])
    times = np.array([0.0, *there, *back, ROUND])
    return straight_way(times, np.concatenate([places, trip.places[-1:]]), faces)


def _slots(middle: Floats, size: int, turn: float) -> tuple[Floats, Floats]:
    """Give the places ``(size, 2)`` around a group's middle, and the point ``(2,)`` that it looks at."""
    if size == 1:
        return middle[None], middle + np.array([np.cos(turn), np.sin(turn)])
    angles = turn + 2 * np.pi * np.arange(size) / size
    radius = _SHOULDERS / 2 / np.sin(np.pi / size)
    slots = middle + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    # Two stand side by side, half turned to each other; more stand in a ring.
    ahead = _ASIDE * np.array([-np.sin(turn), np.cos(turn)]) if size == 2 else np.zeros(2)  # noqa: PLR2004
    return slots, middle + ahead


def _keep(groups: list[list[int]], count: int) -> Floats:
    """Say how far any two should keep apart: ``(count, count)`` metres."""
    keep = np.full((count, count), _KEEP_OTHERS)
    for group in groups:
        keep[np.ix_(group, group)] = _KEEP_GROUP
    return keep
