"""Who is where: every walker's visits, planned so that people meet but do not walk through each other.

A walker's time is cut into visits of a fixed length. A visit is a pure function of the seed, the walker and
the visit's number, so any frame can be asked for at once, in any process. Of several ways drawn at random a
walker takes the one that keeps furthest from the walkers with smaller numbers.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.cameras.sightlines import lurking
from synthetic.room.room import Room
from synthetic.walking.route import Meeting, Visit, draw
from synthetic.walking.sidestepping import bumps, sidestep
from synthetic.walking.stroll import SAMPLES_PER_SECOND, Pose, Stroll

_VISIT = 56.0  # seconds, from one coming in to the next
_VISIT_STEP = 3.0  # seconds: walkers' visits differ in length, so that company changes
_FIRST = (
    40.0,
    58.0,
    31.0,
    49.0,
)  # seconds into the scene at which those who were there from the start are gone
_FIRST_STEP = 2.3  # seconds, for every four walkers more
_UNDER_WAY = 1.0  # seconds before the scene begins at which its first visits do: everybody walks at frame 0
_RESTLESS = _UNDER_WAY + 4.5  # seconds of the first visits in which nobody stands: a background is learnt
_CANDIDATES = 16
_CROWD = (6, 8)  # in a crowd nobody keeps clear of all: from the sixth walker on, so many candidates
_BRISK = 0.5  # metres per second, at least, as long as nobody stands
_COARSE = 4  # every fourth sample is compared
_RATE = SAMPLES_PER_SECOND / _COARSE
_EYES = 3  # cameras before which the ways are staged: the first of the room
_SPREAD = 2.6  # metres that people are apart at the scene's beginning
_FIRST_SIGHT = 4.0  # how much more being apart counts at the beginning
_LEARNT = 2.0  # seconds in which a background is learnt
_GATHERING = 17.0  # seconds from one meeting to the next
_SLOTS = 5  # places around a meeting
_BEFORE = 10_000  # visits before the scene begins have numbers too, and a seed takes none below zero


class Walkers:
    """All walkers of a scene; walker 0 is object 1."""

    def __init__(self, room: Room, count: int, seed: int) -> None:
        self._room = room
        self._count = count
        self._seed = seed
        self._points = tuple(view.position[:2] for view in room.viewpoints[:_EYES])
        self._eyes = np.array(self._points)
        self._stroll = lru_cache(maxsize=16 * max(count, 1) + 16)(self._plan)

    def poses(self, seconds: float) -> list[Pose]:
        """Give every walker's pose at a moment of the scene."""
        return [self._pose(walker, seconds) for walker in range(self._count)]

    def _visit(self, walker: int, seconds: float) -> int:
        """Give the number of the visit that a walker is on."""
        since = seconds - self._begin(walker, 1)
        return max(int(since // self._length(walker)) + 1, 0)

    def _length(self, walker: int) -> float:
        return _VISIT + _VISIT_STEP * (walker * 3 % 5)

    def _begin(self, walker: int, visit: int) -> float:
        """Give the moment of the scene at which a visit begins."""
        if visit == 0:
            return -_UNDER_WAY
        return _FIRST[walker % 4] + _FIRST_STEP * (walker // 4) + (visit - 1) * self._length(walker)

    def _pose(self, walker: int, seconds: float) -> Pose:
        visit = self._visit(walker, seconds)
        return self._stroll(walker, visit).at(seconds - self._begin(walker, visit))

    def _plan(self, walker: int, visit: int) -> Stroll:
        begin = self._begin(walker, visit)
        length = self._begin(walker, visit + 1) - begin
        rng = np.random.default_rng([self._seed, 0x3A1C, walker, visit + _BEFORE])
        pace = float(rng.uniform(0.78, 1.08))
        meetings = self._meetings(begin, length)
        others = self._others(walker, begin, length)
        slot = 2 * np.pi * (walker % _SLOTS) / _SLOTS
        best, least = None, np.inf
        for _ in range(_CANDIDATES if walker < _CROWD[0] or not visit else _CROWD[1]):
            delay = float(rng.uniform(0.0, 4.0)) if visit else 0.0
            given = Visit(
                length - delay - 1.0,
                pace,
                meetings,
                slot,
                self._points,
                visit == 0,
                0.0 if visit else _RESTLESS,
            )
            stroll = Stroll.along(draw(rng, self._room, given), length, delay)
            cost = self._rate(_coarse(stroll, others), others, first=visit == 0)
            if cost < least:
                best, least = stroll, cost
        if best is None:
            raise AssertionError("no way was drawn")
        polite = sidestep(self._room, _coarse(best, others), others, _RATE)
        return best.moved(polite, _COARSE)

    def _rate(self, mine: Floats, others: Floats, *, first: bool) -> float:
        """Rate a way ``(T, 2)`` beside those of the others ``(O, T, 2)``; less is better."""
        cost = bumps(mine, others)
        if first:
            start = slice(int(_UNDER_WAY * _RATE), int(_RESTLESS * _RATE))
            cost += _FIRST_SIGHT * bumps(mine[start], others[:, start], _SPREAD)
            speeds = np.hypot(*np.diff(mine[start], axis=0).T) * _RATE
            cost += float(np.maximum(_BRISK - speeds, 0).sum())
            cost += lurking(mine[start][: int(_LEARNT * _RATE)], self._eyes)
        return cost

    def _meetings(self, begin: float, length: float) -> tuple[Meeting, ...]:
        """Give the gatherings of a visit; all walkers know of the same ones."""
        found = []
        for number in range(int(begin // _GATHERING), int((begin + length) // _GATHERING) + 1):
            rng = np.random.default_rng([self._seed, 0x6A7E, number + _BEFORE])
            place = (
                float(rng.uniform(2.6, self._room.width - 2.6)),
                float(rng.uniform(2.2, self._room.depth - 2.2)),
            )
            start = number * _GATHERING - begin
            found.append(Meeting(place, start + 4.0, start + 9.0))
        return tuple(found)

    def _others(self, walker: int, begin: float, length: float) -> Floats:
        """Sample where the walkers before this one are during a visit: ``(others, T, 2)`` metres."""
        clock = begin + np.arange(0, int(length * SAMPLES_PER_SECOND), _COARSE) / SAMPLES_PER_SECOND
        places = np.empty((walker, len(clock), 2))
        for other in range(walker):
            for visit in range(self._visit(other, clock[0]), self._visit(other, clock[-1]) + 1):
                start, end = self._begin(other, visit), self._begin(other, visit + 1)
                now = (clock >= start) & (clock < end)
                index = ((clock[now] - start) * SAMPLES_PER_SECOND).astype(np.int64)
                places[other, now] = self._stroll(other, visit).places[index]
        return places


def _coarse(stroll: Stroll, others: Floats) -> Floats:
    return stroll.places[: others.shape[1] * _COARSE : _COARSE]
