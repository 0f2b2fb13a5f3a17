"""Who is in an area, and who crosses a line, without flutter at the border."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol, TypeVar

from server.rules.rules import Direction
from server.rules.zones import Area, Line, Point


@dataclass(frozen=True, slots=True)
class Change:
    """Someone's step over a border.

    Attributes:
        person: their number.
        pulse: the frame in which they stepped over it.
        inward: whether to the inside.
    """

    person: int
    pulse: int
    inward: bool

    @property
    def direction(self) -> Direction:
        """The direction over a line."""
        return Direction.INWARD if self.inward else Direction.OUTWARD


@dataclass(frozen=True, slots=True)
class Sighting:
    """Where someone is in a frame.

    Attributes:
        person: their number.
        point: where, in the zone's unit.
        cameras: those that see them there.
    """

    person: int
    point: Point
    cameras: frozenset[str]


class _PersonState(Protocol):
    last_seen: int
    cameras: frozenset[str]
    unseen: int


@dataclass(slots=True)
class _Visit:
    """A person's state in an area.

    Attributes:
        inside: whether they are in the area.
        since: the first frame of that.
        changing_since: the first frame of the other state that has not lasted yet; None: there is none.
        unseen: frames since ``last_seen`` in which one of ``cameras``, which saw them then, could see them.
    """

    inside: bool
    since: int
    last_seen: int
    cameras: frozenset[str]
    changing_since: int | None = None
    unseen: int = 0


@dataclass(slots=True)
class _Side:
    """A person's side of a line.

    Attributes:
        inward: whether they are on the inner side.
        point: where they were last.
        steps: steps inward between the line's ends, less those outward, since the side was certain.
        stepped: the frame of the last of them.
        beyond_since: the first frame beyond the margin on the other side; None: they are not there.
    """

    inward: bool
    point: Point
    last_seen: int
    cameras: frozenset[str]
    steps: int = 0
    stepped: int = 0
    beyond_since: int | None = None
    unseen: int = 0


class AreaPresence:
    """Who is in an area; ``area`` None: anywhere on the site.

    Someone is inside from the border on, and outside from the margin on, if that lasts for the area's hold.
    Who is not seen for ``absent`` frames by cameras that could see them has left.
    """

    def __init__(self, area: Area | None, absent: int) -> None:
        self._area, self._absent = area, absent
        self._hold = 0 if area is None else area.hold
        self._visits: dict[int, _Visit] = {}

    @property
    def inside(self) -> dict[int, int]:
        """By number of everyone inside: the first frame of the visit."""
        return {person: visit.since for person, visit in self._visits.items() if visit.inside}

    def update(self, pulse: int, sightings: Iterable[Sighting], usable: frozenset[str]) -> list[Change]:
        """Process a frame: where people are, and the cameras that could see them; return changes."""
        changes = [change for sighting in sightings if (change := self._move(sighting, pulse)) is not None]
        for person in _lost(self._visits, pulse, usable, self._absent):
            visit = self._visits.pop(person)
            if visit.inside:
                changes.append(Change(person, visit.last_seen, inward=False))
        return changes

    def merge(self, kept: int, lost: int) -> None:
        """Two numbers are one person: who either has entered is inside, without an event."""
        visit, other = self._visits.get(kept), self._visits.pop(lost, None)
        if other is None:
            return
        if visit is None:
            self._visits[kept] = other
            return
        newest = max(visit, other, key=lambda each: each.last_seen)
        visit.last_seen, visit.cameras, visit.unseen = newest.last_seen, newest.cameras, newest.unseen
        if other.inside:
            visit.since = min(visit.since, other.since) if visit.inside else other.since
        visit.inside, visit.changing_since = visit.inside or other.inside, None

    def forget(self, person: int) -> None:
        """Forget someone, without an event."""
        self._visits.pop(person, None)

    def split(self, kept: int, new: int) -> None:
        """A number stood for two people: the new one begins where the other is, without an event."""
        visit = self._visits.get(kept)
        if visit is not None and new not in self._visits:
            self._visits[new] = _Visit(visit.inside, visit.since, visit.last_seen, visit.cameras)

    def _move(self, sighting: Sighting, pulse: int) -> Change | None:
        person, point, cameras = sighting.person, sighting.point, sighting.cameras
        visit = self._visits.get(person)
        if visit is None:
            visit = self._visits[person] = _Visit(inside=False, since=pulse, last_seen=pulse, cameras=cameras)
        visit.last_seen, visit.cameras, visit.unseen = pulse, cameras, 0
        is_inside = self._area is None or self._area.depth(point) > (
            -self._area.margin if visit.inside else 0.0
        )
        if is_inside == visit.inside:
            visit.changing_since = None
            return None
        if visit.changing_since is None:
            visit.changing_since = pulse
        if pulse - visit.changing_since < self._hold:
            return None
        visit.inside, visit.since, visit.changing_since = is_inside, visit.changing_since, None
        return Change(person, visit.since, is_inside)


class LineCrossings:
    """Who crosses a line: between its ends, and then beyond its margin for its hold."""

    def __init__(self, line: Line) -> None:
        self._line = line
        self._sides: dict[int, _Side] = {}

    def update(self, pulse: int, sightings: Iterable[Sighting], usable: frozenset[str]) -> list[Change]:
        """Process a frame, as `AreaPresence.update`; return crossings."""
        changes = [change for sighting in sightings if (change := self._move(sighting, pulse)) is not None]
        for person in _lost(self._sides, pulse, usable, self._line.absent):
            del self._sides[person]
        return changes

    def merge(self, kept: int, lost: int) -> None:
        """Two numbers are one person, who is where they were seen last."""
        other = self._sides.pop(lost, None)
        if other is not None and (kept not in self._sides or self._sides[kept].last_seen < other.last_seen):
            self._sides[kept] = other

    def forget(self, person: int) -> None:
        """Forget someone."""
        self._sides.pop(person, None)

    def split(self, kept: int, new: int) -> None:
        """A number stood for two people: the new one's side is found anew."""

    def _move(self, sighting: Sighting, pulse: int) -> Change | None:
        person, point, cameras = sighting.person, sighting.point, sighting.cameras
        depth = self._line.depth(point)
        side = self._sides.get(person)
        if side is None:
            self._sides[person] = _Side(depth >= 0.0, point, pulse, cameras)
            return None
        if self._line.crossed_by(side.point, point):
            side.steps += 1 if depth >= 0.0 else -1
            side.stepped = pulse
        side.point, side.last_seen, side.cameras, side.unseen = point, pulse, cameras, 0
        if (depth >= 0.0) == side.inward:
            side.beyond_since = None
            if abs(depth) > self._line.margin:
                side.steps = 0  # round an end and back, or back over the line
            return None
        if abs(depth) <= self._line.margin:
            side.beyond_since = None
            return None
        if side.beyond_since is None:
            side.beyond_since = pulse
        if pulse - side.beyond_since < self._line.hold:
            return None
        side.inward = not side.inward
        steps, side.steps, side.beyond_since = side.steps, 0, None
        crossed = steps > 0 if side.inward else steps < 0
        return Change(person, side.stepped, side.inward) if crossed else None


_State = TypeVar("_State", bound=_PersonState)


def _lost(states: Mapping[int, _State], pulse: int, usable: frozenset[str], absent: int) -> list[int]:
    """Count a frame for everyone who is not seen though a camera could see them; return who is lost by it.

    Where a camera fails, nobody leaves.
    """
    lost = []
    for person, state in states.items():
        if state.last_seen == pulse or not state.cameras & usable:
            continue
        state.unseen += 1
        if state.unseen >= absent:
            lost.append(person)
    return lost
