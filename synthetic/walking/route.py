"""One visit to the room: a way drawn at random, then walked at a pace that people have."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from synthetic.cameras.sightlines import Shot, follow, shoot
from synthetic.room.room import Door, Point, Room

_MARGIN = 1.0  # metres kept from walls
_CORNER = 2.6  # metres kept from the room's corners: cameras hang there, and see nobody's feet beneath them
_CLEARANCE = 0.45  # metres kept from furniture
_TRIES = 40
_CHOICE = 6  # places that one chooses from
_NEAREST = 2.0  # metres from one place to the next
_CIRCLE = 0.7  # metres from the middle of a meeting to who takes part


@dataclass(frozen=True, slots=True)
class Leg:
    """Walk to a point, then stand there for a while."""

    end: Point
    pause: float = 0.0  # seconds
    face: Point | None = None  # what to look at while standing


@dataclass(slots=True)
class Route:
    """The legs of a visit and the seconds that they take at a given pace."""

    start: Point
    pace: float  # metres per second
    eyes: tuple[Point, ...]  # the cameras before which it is walked
    legs: list[Leg] = field(default_factory=list)
    seconds: float = 0.0
    shot: Shot = field(init=False)  # which of them sees the walker best when the route has come here

    def __post_init__(self) -> None:
        """Look at the start."""
        self.shot = shoot(self.start, self.eyes)

    @property
    def here(self) -> Point:
        """Where the route has come to."""
        return self.legs[-1].end if self.legs else self.start

    def add(self, leg: Leg) -> None:
        """Append a leg."""
        seconds = math.dist(self.here, leg.end) / self.pace
        self.shot = follow(self.shot, self.here, leg.end, seconds, self.eyes)
        self.shot = follow(self.shot, leg.end, leg.end, leg.pause, self.eyes)
        self.seconds += seconds + leg.pause
        self.legs.append(leg)


@dataclass(frozen=True, slots=True)
class Meeting:
    """A place where people stand together for a while."""

    place: Point
    begin: float  # seconds into the visit
    end: float


def clear(room: Room, start: Point, end: Point) -> bool:
    """Say whether one can walk straight from a point to another."""
    steps = max(int(math.dist(start, end) / 0.1), 1)
    share = np.linspace(0, 1, steps + 1)
    x = start[0] + (end[0] - start[0]) * share
    y = start[1] + (end[1] - start[1]) * share
    west, south, east, north = room.footprints().T[:, :, None]
    dx = np.maximum(np.maximum(west - x, x - east), 0)
    dy = np.maximum(np.maximum(south - y, y - north), 0)
    return not bool((dx * dx + dy * dy < _CLEARANCE**2).any())


@dataclass(frozen=True, slots=True)
class Visit:
    """What is given before a way is drawn."""

    seconds: float  # that it may take
    pace: float  # metres per second
    meetings: tuple[Meeting, ...]  # where others gather meanwhile
    slot: float  # radians: the side from which this walker joins a meeting
    eyes: tuple[Point, ...]  # of the cameras before which the way is staged
    begun: bool = False  # in the room already, walking
    restless: float = 0.0  # seconds from the visit's beginning in which there is no standing


def draw(rng: np.random.Generator, room: Room, visit: Visit) -> Route:
    """Draw a visit: in by one door, about the room, out by a door, away to the side."""
    way_in, way_out = (room.doors[int(rng.integers(len(room.doors)))] for _ in range(2))
    hall = _hall(rng, room, way_out)
    leave = 3.0 / visit.pace
    exit_point = room.beyond(way_out, 0.0, -0.9)
    if visit.begun:
        route = _under_way(rng, room, visit, exit_point)
    else:
        route = Route(_hall(rng, room, way_in), visit.pace, visit.eyes)
        for out in (0.75, -0.9):
            route.add(Leg(room.beyond(way_in, 0.0, out)))
    while True:
        leg = _next(rng, room, route, exit_point, visit)
        cost = (
            math.dist(route.here, leg.end) / visit.pace
            + leg.pause
            + math.dist(leg.end, exit_point) / visit.pace
        )
        if route.seconds + cost + leave > visit.seconds:
            break
        route.add(leg)
    for out in (-0.9, 0.75):
        route.add(Leg(room.beyond(way_out, 0.0, out)))
    route.add(Leg(hall))
    return route


def _hall(rng: np.random.Generator, room: Room, door: Door) -> Point:
    """Choose a side of the corridor, out of sight of the doorway."""
    side = 2.2 if rng.random() < 0.5 else -2.2  # noqa: PLR2004 — even chances
    return room.beyond(door, side, 0.75)


def _under_way(rng: np.random.Generator, room: Room, visit: Visit, home: Point) -> Route:
    """Begin anywhere in the room, on the way to somewhere far."""
    route = Route(_spot(rng, room), visit.pace, visit.eyes)
    for _ in range(2 * _TRIES):
        route = Route(_spot(rng, room), visit.pace, visit.eyes)
        end = _spot(rng, room)
        far = math.dist(route.here, end) > visit.restless * visit.pace
        if far and clear(room, route.here, end) and clear(room, end, home):
            route.add(Leg(end))
            break
    return route


def _next(rng: np.random.Generator, room: Room, route: Route, home: Point, visit: Visit) -> Leg:
    for meeting in visit.meetings:
        arrival = route.seconds + math.dist(route.here, meeting.place) / route.pace
        due = meeting.begin <= arrival < meeting.end and arrival > visit.restless
        if due and rng.random() < 0.6:  # noqa: PLR2004 — most go and meet
            x, y = meeting.place
            end = (x + _CIRCLE * math.cos(visit.slot), y + _CIRCLE * math.sin(visit.slot))
            if clear(room, route.here, end) and clear(room, end, home):
                return Leg(end, rng.uniform(1.5, meeting.end - arrival + 1.5), meeting.place)
    end = _way(rng, room, route, home, visit)
    arrival = route.seconds + math.dist(route.here, end) / route.pace
    stays = rng.random() < 0.45 and arrival > visit.restless  # noqa: PLR2004 — not at every turn
    pause = rng.uniform(1.5, 4.5) if stays else 0.0
    turn = rng.uniform(0, 2 * np.pi)
    return Leg(end, pause, (end[0] + math.cos(turn), end[1] + math.sin(turn)))


def _way(rng: np.random.Generator, room: Room, route: Route, home: Point, visit: Visit) -> Point:
    """Choose where to go next: of some places, one on the way to which the best view changes in good time."""
    best, least, found = home, np.inf, 0
    for _ in range(_TRIES):
        end = _spot(rng, room)
        far = math.dist(route.here, end)
        # No pacing on the spot.
        if far > _NEAREST and clear(room, route.here, end) and clear(room, end, home):
            fault = follow(route.shot, route.here, end, far / route.pace, visit.eyes).fault
            if fault < least:
                best, least = end, fault
            found += 1
            if found == _CHOICE or fault == 0:
                break
    return best


def _spot(rng: np.random.Generator, room: Room) -> Point:
    """Choose a place to go to: off the walls and out of the corners."""
    while True:
        x, y = rng.uniform(_MARGIN, room.width - _MARGIN), rng.uniform(_MARGIN, room.depth - _MARGIN)
        if math.hypot(min(x, room.width - x), min(y, room.depth - y)) > _CORNER:
            return (x, y)
