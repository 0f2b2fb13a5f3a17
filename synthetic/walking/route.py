"""Random routes through a room: in by a door, from position to position, and out by a door."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from synthetic.room.room import Door, Point, Room

_MARGIN = 1.0  # meters kept from walls
_CORNER = 2.6  # meters kept from the room's corners: feet below the cameras there are out of view
_CLEARANCE = 0.45  # meters kept from furniture
_TRIES = 40
_CHOICE = 6  # candidate positions
_NEAREST = 2.0  # least meters between successive positions
_CIRCLE = 0.7  # meters from the middle of a meeting to each participant
_BETTER = 1.3  # factor by which a view must be larger than the best one to replace it
_ABOVE = 2.1  # meters from a body's center up to a camera
_FRAME = 0.4  # seconds between two comparisons of the cameras
_SOONEST, _LATEST = 7.0, 13.0  # seconds for which one camera should be the best


@dataclass(frozen=True, slots=True)
class Leg:
    """Walk to a point, then stand there for a while."""

    end: Point
    pause: float = 0.0  # seconds
    face: Point | None = None  # point to face while standing


@dataclass(slots=True)
class Route:
    """The legs of a visit and their duration at a given pace."""

    start: Point
    pace: float  # meters per second
    camera_positions: tuple[Point, ...]  # the cameras whose best view should change from time to time
    legs: list[Leg] = field(default_factory=list)
    seconds: float = 0.0
    best_view: BestView = field(init=False)  # of the person at the end of the route

    def __post_init__(self) -> None:
        """Find the best view of the start."""
        self.best_view = best_view_at(self.start, self.camera_positions)

    @property
    def here(self) -> Point:
        """The current end of the route."""
        return self.legs[-1].end if self.legs else self.start

    def add(self, leg: Leg) -> None:
        """Append a leg."""
        seconds = math.dist(self.here, leg.end) / self.pace
        self.best_view = follow_best_view(self.best_view, self.here, leg.end, seconds, self.camera_positions)
        self.best_view = follow_best_view(self.best_view, leg.end, leg.end, leg.pause, self.camera_positions)
        self.seconds += seconds + leg.pause
        self.legs.append(leg)


@dataclass(frozen=True, slots=True)
class Meeting:
    """A place where people stand together for a while."""

    place: Point
    begin: float  # seconds into the visit
    end: float


def is_clear_of_furniture(room: Room, start: Point, end: Point) -> bool:
    """Return whether a straight walk between two points is free of furniture."""
    steps = max(int(math.dist(start, end) / 0.1), 1)
    share = np.linspace(0, 1, steps + 1)
    x = start[0] + (end[0] - start[0]) * share
    y = start[1] + (end[1] - start[1]) * share
    west, south, east, north = room.footprints().T[:, :, None]
    dx = np.maximum(np.maximum(west - x, x - east), 0)
    dy = np.maximum(np.maximum(south - y, y - north), 0)
    return not bool((dx * dx + dy * dy < _CLEARANCE**2).any())


@dataclass(frozen=True, slots=True)
class VisitPlan:
    """The constraints of a random route."""

    seconds: float  # available time
    pace: float  # meters per second
    meetings: tuple[Meeting, ...]  # meetings during the visit
    meeting_angle: float  # radians: the side from which this person joins a meeting
    camera_positions: tuple[Point, ...]  # the best view should change between these from time to time
    begun: bool = False  # in the room already, walking
    no_pause_seconds: float = 0.0  # seconds from the visit's beginning in which there is no standing


def draw_route(rng: np.random.Generator, room: Room, visit: VisitPlan) -> Route:
    """Draw a random route: in by one door, through the room, out by a door, and away to the side."""
    way_in, way_out = (room.doors[int(rng.integers(len(room.doors)))] for _ in range(2))
    corridor = _corridor_side(rng, room, way_out)
    leave = 3.0 / visit.pace
    exit_point = room.beyond(way_out, 0.0, -0.9)
    if visit.begun:
        route = _begin_inside(rng, room, visit, exit_point)
    else:
        route = Route(_corridor_side(rng, room, way_in), visit.pace, visit.camera_positions)
        for out in (0.75, -0.9):
            route.add(Leg(room.beyond(way_in, 0.0, out)))
    while True:
        leg = _choose_leg(rng, room, route, exit_point, visit)
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
    route.add(Leg(corridor))
    return route


def _corridor_side(rng: np.random.Generator, room: Room, door: Door) -> Point:
    """Choose a side of the corridor, out of sight of the doorway."""
    side = 2.2 if rng.random() < 0.5 else -2.2  # noqa: PLR2004 — even chances
    return room.beyond(door, side, 0.75)


def _begin_inside(rng: np.random.Generator, room: Room, visit: VisitPlan, home: Point) -> Route:
    """Draw the first leg of a route that begins in the room: between two distant random positions."""
    route = Route(_draw_place(rng, room), visit.pace, visit.camera_positions)
    for _ in range(2 * _TRIES):
        route = Route(_draw_place(rng, room), visit.pace, visit.camera_positions)
        end = _draw_place(rng, room)
        is_far = math.dist(route.here, end) > visit.no_pause_seconds * visit.pace
        if is_far and is_clear_of_furniture(room, route.here, end) and is_clear_of_furniture(room, end, home):
            route.add(Leg(end))
            break
    return route


def _choose_leg(rng: np.random.Generator, room: Room, route: Route, home: Point, visit: VisitPlan) -> Leg:
    for meeting in visit.meetings:
        arrival = route.seconds + math.dist(route.here, meeting.place) / route.pace
        due = meeting.begin <= arrival < meeting.end and arrival > visit.no_pause_seconds
        if due and rng.random() < 0.6:  # noqa: PLR2004 — most people join
            x, y = meeting.place
            end = (x + _CIRCLE * math.cos(visit.meeting_angle), y + _CIRCLE * math.sin(visit.meeting_angle))
            if is_clear_of_furniture(room, route.here, end) and is_clear_of_furniture(room, end, home):
                return Leg(end, rng.uniform(1.5, meeting.end - arrival + 1.5), meeting.place)
    end = _choose_place(rng, room, route, home, visit)
    arrival = route.seconds + math.dist(route.here, end) / route.pace
    stays = rng.random() < 0.45 and arrival > visit.no_pause_seconds  # noqa: PLR2004 — not at every position
    pause = rng.uniform(1.5, 4.5) if stays else 0.0
    turn = rng.uniform(0, 2 * np.pi)
    return Leg(end, pause, (end[0] + math.cos(turn), end[1] + math.sin(turn)))


def _choose_place(rng: np.random.Generator, room: Room, route: Route, home: Point, visit: VisitPlan) -> Point:
    """Choose the next position: one on the way to which the best view changes at a suitable time."""
    best, lowest, candidates = home, np.inf, 0
    for _ in range(_TRIES):
        end = _draw_place(rng, room)
        distance = math.dist(route.here, end)
        # No short moves.
        if (
            distance > _NEAREST
            and is_clear_of_furniture(room, route.here, end)
            and is_clear_of_furniture(room, end, home)
        ):
            penalty = follow_best_view(
                route.best_view, route.here, end, distance / route.pace, visit.camera_positions
            ).penalty
            if penalty < lowest:
                best, lowest = end, penalty
            candidates += 1
            if candidates == _CHOICE or penalty == 0:
                break
    return best


def _draw_place(rng: np.random.Generator, room: Room) -> Point:
    """Draw a position away from walls and corners."""
    while True:
        x, y = rng.uniform(_MARGIN, room.width - _MARGIN), rng.uniform(_MARGIN, room.depth - _MARGIN)
        if math.hypot(min(x, room.width - x), min(y, room.depth - y)) > _CORNER:
            return (x, y)


@dataclass(frozen=True, slots=True)
class BestView:
    """The camera in which a person appears largest, and for how long it has been the same."""

    camera: int
    held_seconds: float
    penalty: float = 0.0  # of the last walk: seconds by which the best view changed too early or too late


def best_view_at(where: Point, camera_positions: tuple[Point, ...]) -> BestView:
    """Return the best view of a person who begins at a point."""
    sizes = _sizes(where, camera_positions)
    return BestView(sizes.index(max(sizes)), 0.0)


def follow_best_view(
    best_view: BestView, start: Point, end: Point, seconds: float, camera_positions: tuple[Point, ...]
) -> BestView:
    """Return the best view after a walk from a point to another, and the penalty of this walk alone."""
    camera, held_seconds, penalty = best_view.camera, best_view.held_seconds, 0.0
    steps = max(math.ceil(seconds / _FRAME), 1)
    for step in range(1, steps + 1):
        held_seconds += seconds / steps
        share = step / steps
        sizes = _sizes(
            (start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share), camera_positions
        )
        best = max(sizes)
        if best > _BETTER * sizes[camera]:
            penalty += max(_SOONEST - held_seconds, held_seconds - _LATEST, 0.0)
            camera, held_seconds = sizes.index(best), 0.0
    return BestView(camera, held_seconds, penalty + max(held_seconds - _LATEST, 0.0))


def _sizes(where: Point, camera_positions: tuple[Point, ...]) -> list[float]:
    x, y = where
    return [1 / ((x - camera[0]) ** 2 + (y - camera[1]) ** 2 + _ABOVE**2) for camera in camera_positions]
