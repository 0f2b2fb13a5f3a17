"""A crowd of visitors, planned so that people meet but do not walk through each other.

A walker's time is divided into visits of a fixed length. A visit is a pure function of the seed, the walker
and the visit's number, so any frame can be drawn directly, in any process. Of several random routes a
walker uses the one with the largest distance from walkers with smaller numbers.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.room.room import Room
from synthetic.walking.collision_avoidance import proximity_cost, sidestep
from synthetic.walking.route import Meeting, VisitPlan, draw_route
from synthetic.walking.trajectory import SAMPLES_PER_SECOND, Pose, Trajectory

_VISIT = 56.0  # seconds from one arrival to the next
_VISIT_STEP = 3.0  # seconds: walkers' visits differ in length, so that the people present change
_FIRST = (40.0, 58.0, 31.0, 49.0)  # seconds into the scene at which the first visits end
_FIRST_STEP = 2.3  # seconds added for every four walkers
_UNDER_WAY = 1.0  # seconds from the first visits' beginning to frame 0: in which all people walk
_NO_PAUSE = _UNDER_WAY + 4.5  # seconds of the first visits without standing, for background learning
_CANDIDATES = 16
_CROWD = (6, 8)  # from walker 6 on there are 8 candidates: in a crowd no route is free
_BRISK = 0.5  # least meters per second during these
_COARSE = 4  # every fourth sample is compared
_RATE = SAMPLES_PER_SECOND / _COARSE
_STAGED_CAMERAS = 3  # cameras between which the best view should change: the room's first
_SPREAD = 2.6  # meters between people at the scene's beginning
_FIRST_SIGHT = 4.0  # weight of that distance
_LEARNING = 2.0  # seconds in which detectors learn the background
_GATHERING = 17.0  # seconds from one meeting to the next
_SLOTS = 5  # places around a meeting
_BEFORE = 10_000  # added to numbers of visits in seeds, which cannot be negative
_STEP = 0.7  # meters across the image after which a person hides other background


class VisitingCrowd:
    """The people of a room, who enter and leave by its doors; walker 0 is object 1."""

    def __init__(self, room: Room, count: int, seed: int) -> None:
        self._room = room
        self._count = count
        self._seed = seed
        self._camera_positions = tuple(view.position[:2] for view in room.viewpoints[:_STAGED_CAMERAS])
        self._camera_array = np.array(self._camera_positions)
        self._trajectory = lru_cache(maxsize=16 * max(count, 1) + 16)(self._plan)

    def poses(self, seconds: float) -> list[Pose]:
        """Return all poses at a moment of the scene."""
        return [self._pose(walker, seconds) for walker in range(self._count)]

    def _visit(self, walker: int, seconds: float) -> int:
        """Return the number of a walker's visit at a moment."""
        since = seconds - self._begin(walker, 1)
        return max(int(since // self._length(walker)) + 1, 0)

    def _length(self, walker: int) -> float:
        return _VISIT + _VISIT_STEP * (walker * 3 % 5)

    def _begin(self, walker: int, visit: int) -> float:
        """Return the moment of the scene at which a visit begins."""
        if visit == 0:
            return -_UNDER_WAY
        return _FIRST[walker % 4] + _FIRST_STEP * (walker // 4) + (visit - 1) * self._length(walker)

    def _pose(self, walker: int, seconds: float) -> Pose:
        visit = self._visit(walker, seconds)
        return self._trajectory(walker, visit).at(seconds - self._begin(walker, visit))

    def _plan(self, walker: int, visit: int) -> Trajectory:
        begin = self._begin(walker, visit)
        length = self._begin(walker, visit + 1) - begin
        rng = np.random.default_rng([self._seed, 0x3A1C, walker, visit + _BEFORE])
        pace = float(rng.uniform(0.78, 1.08))
        meetings = self._meetings(begin, length)
        others = self._others(walker, begin, length)
        meeting_angle = 2 * np.pi * (walker % _SLOTS) / _SLOTS
        best, lowest = None, np.inf
        for _ in range(_CANDIDATES if walker < _CROWD[0] or not visit else _CROWD[1]):
            delay = float(rng.uniform(0.0, 4.0)) if visit else 0.0
            plan = VisitPlan(
                length - delay - 1.0,
                pace,
                meetings,
                meeting_angle,
                self._camera_positions,
                visit == 0,
                0.0 if visit else _NO_PAUSE,
            )
            trajectory = Trajectory.along(draw_route(rng, self._room, plan), length, delay)
            cost = self._cost(_coarse(trajectory, others), others, first=visit == 0)
            if cost < lowest:
                best, lowest = trajectory, cost
        if best is None:
            raise AssertionError("no route was drawn")
        sidestepped = sidestep(self._room, _coarse(best, others), others, _RATE)
        return best.moved(sidestepped, _COARSE)

    def _cost(self, path: Floats, others: Floats, *, first: bool) -> float:
        """Return the cost of a path ``(T, 2)`` given those of others ``(O, T, 2)``."""
        cost = proximity_cost(path, others)
        if first:
            start = slice(int(_UNDER_WAY * _RATE), int(_NO_PAUSE * _RATE))
            cost += _FIRST_SIGHT * proximity_cost(path[start], others[:, start], _SPREAD)
            speeds = np.hypot(*np.diff(path[start], axis=0).T) * _RATE
            cost += float(np.maximum(_BRISK - speeds, 0).sum())
            cost += missing_lateral_motion_penalty(path[start][: int(_LEARNING * _RATE)], self._camera_array)
        return cost

    def _meetings(self, begin: float, length: float) -> tuple[Meeting, ...]:
        """Return the meetings during a visit; they are the same for all walkers."""
        meetings = []
        for number in range(int(begin // _GATHERING), int((begin + length) // _GATHERING) + 1):
            rng = np.random.default_rng([self._seed, 0x6A7E, number + _BEFORE])
            place = (
                float(rng.uniform(2.6, self._room.width - 2.6)),
                float(rng.uniform(2.2, self._room.depth - 2.2)),
            )
            start = number * _GATHERING - begin
            meetings.append(Meeting(place, start + 4.0, start + 9.0))
        return tuple(meetings)

    def _others(self, walker: int, begin: float, length: float) -> Floats:
        """Sample the positions of walkers with smaller numbers during a visit: ``(others, T, 2)`` meters."""
        clock = begin + np.arange(0, int(length * SAMPLES_PER_SECOND), _COARSE) / SAMPLES_PER_SECOND
        places = np.empty((walker, len(clock), 2))
        for other in range(walker):
            for visit in range(self._visit(other, clock[0]), self._visit(other, clock[-1]) + 1):
                start, end = self._begin(other, visit), self._begin(other, visit + 1)
                now = (clock >= start) & (clock < end)
                index = ((clock[now] - start) * SAMPLES_PER_SECOND).astype(np.int64)
                places[other, now] = self._trajectory(other, visit).places[index]
        return places


def _coarse(trajectory: Trajectory, others: Floats) -> Floats:
    return trajectory.places[: others.shape[1] * _COARSE : _COARSE]


def missing_lateral_motion_penalty(path: Floats, camera_positions: Floats) -> float:
    """Return the cost of a path ``(T, 2)`` for moving too little across the images of cameras ``(C, 2)``."""
    cost = 0.0
    for camera in camera_positions:
        sight = path[0] - camera
        step = path[-1] - path[0]
        across = abs(float(sight[0] * step[1] - sight[1] * step[0])) / max(float(np.hypot(*sight)), 1e-6)
        cost += max(_STEP - across, 0.0) ** 2
    return cost
