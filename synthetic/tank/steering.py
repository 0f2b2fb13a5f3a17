"""Steering of fish: random paths in three dimensions that keep clear of each other and of the walls."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.walking.collision_avoidance import push_paths_apart

RATE = 10  # samples a second
LOW = np.array([0.55, 0.55, 0.5])  # meters: corners of the volume in which fish swim
HIGH = np.array([5.45, 4.45, 2.5])
CRUISE = 0.55  # meters per second
_SPEEDS = (0.28, 0.95)  # meters per second
_STEEP = 0.45  # largest vertical over horizontal speed
_WHIM = np.array([0.85, 0.85, 0.22])  # meters per second squared
_WHIM_SECONDS = 0.7  # duration of a random push
_WALL = 0.7  # meters from a wall at which a fish turns away
_WALL_PUSH = 3.2  # meters per second squared and meter
_REACH = 1.35  # meters within which fish avoid each other
_SHY = 6.0  # meters per second squared between two fish at the same position
_FORESEE = 0.45  # seconds of lookahead
_SPURT = 0.6  # meters per second squared
_TURN = 1.9  # largest turn, radians per second
STRAIGHT = 3.0  # seconds of straight swimming before a waypoint
_KEEN = 2.5  # per second: rate at which a fish reaches its desired velocity
_CLOSING = 0.9  # seconds in which a fish tries to close a gap
_CLEAR = 0.55  # smallest distance in meters between two fish near the end
_TRIALS = 4  # attempts to bring all fish near their waypoints
_NEAR = 0.75  # meters from its waypoint at which a fish counts as near
_LANDING = 4.0  # seconds before the end over which the remaining error is corrected


@dataclass(frozen=True, slots=True)
class Waypoints:
    """Positions and velocities of all fish at a moment that all paths pass through."""

    places: Floats  # (P, 3) meters
    velocities: Floats  # (P, 3) meters per second


def swim_between(rng: np.random.Generator, start: Waypoints, end: Waypoints, seconds: float) -> Floats:
    """Return paths between waypoints: ``(T, P, 3)`` meters, `RATE` samples per second, both ends included."""
    trials = []
    for _ in range(_TRIALS):
        trials.append(_try(rng, start, end, seconds))
        if trials[-1].missed < _NEAR:
            break
    best = min(trials, key=lambda trial: trial.missed)
    path = best.path + _landing(
        end.places - best.path[-1], end.velocities - best.velocities, len(best.path) - 1
    )
    last = slice(-round(2 * _LANDING * RATE), None)
    keep = np.full((path.shape[1], path.shape[1]), _CLEAR)
    path[last] = push_paths_apart(path[last].transpose(1, 0, 2), keep, RATE).transpose(1, 0, 2)
    return path


@dataclass(frozen=True, slots=True)
class _Trial:
    path: Floats  # (T, P, 3) meters
    velocities: Floats  # (P, 3) meters per second, at its end
    missed: float  # meters: the largest position error of a fish at the end


def _try(rng: np.random.Generator, start: Waypoints, end: Waypoints, seconds: float) -> _Trial:
    """Steer from the first waypoints towards the second; the error at the end is usually below a meter."""
    steps = round(seconds * RATE)
    whims = _whims(rng, steps, len(start.places))
    place, velocity = start.places.copy(), start.velocities.copy()
    path = np.empty((steps + 1, *place.shape))
    path[0] = place
    for step in range(steps):
        ahead = place + _FORESEE * velocity
        home, urgent = _home(place, velocity, end, seconds - step / RATE)
        push = _walls(ahead) + _others(ahead) + urgent * home
        push += (1 - urgent) * (whims[step] + _pace(velocity))
        velocity = _bounded(velocity + _agile(push, velocity, step) / RATE)
        place = place + velocity / RATE
        path[step + 1] = place
    missed = float(np.linalg.norm(end.places - place, axis=1).max(initial=0.0))
    return _Trial(path, velocity, missed)


def _whims(rng: np.random.Generator, steps: int, fish: int) -> Floats:
    """Draw pushes ``(steps, P, 3)`` that change smoothly."""
    raw = rng.standard_normal((steps, fish * 3))
    sigma = _WHIM_SECONDS * RATE
    soft = cv2.GaussianBlur(raw, (1, 2 * int(3 * sigma) + 1), sigmaX=1, sigmaY=sigma)
    rise = np.clip(np.arange(steps) / (_WHIM_SECONDS * 2 * RATE), 0, 1)[:, None, None]
    whims: Floats = rise * soft.reshape(steps, fish, 3) / max(float(soft.std()), 1e-9) * _WHIM
    return whims


def _home(place: Floats, velocity: Floats, end: Waypoints, remaining: float) -> tuple[Floats, Floats]:
    """Return the pushes ``(P, 3)`` towards the waypoints and their weight ``(P, 1)``: 0 with time to spare.

    A fish aims at a point before its waypoint, and swims the last seconds with the waypoint's velocity.
    """
    straight = min(remaining, STRAIGHT)
    gap = end.places - end.velocities * straight - place
    far = np.linalg.norm(gap, axis=1, keepdims=True)
    desired = gap * np.minimum(1 / _CLOSING, _SPEEDS[1] / np.maximum(far, 1e-6))
    if remaining <= STRAIGHT:
        return _KEEN * (desired + end.velocities - velocity), np.ones_like(far)
    need = far / (0.6 * CRUISE * (remaining - STRAIGHT + 0.1))
    urgent: Floats = np.clip(need, 0, 1) ** 4
    return _KEEN * (desired - velocity), urgent


def _agile(push: Floats, velocity: Floats, step: int) -> Floats:
    """Limit pushes ``(P, 3)`` to a fish's turn rate and acceleration; initially it swims straight."""
    speed = np.maximum(np.linalg.norm(velocity, axis=1, keepdims=True), 1e-6)
    ahead = velocity / speed
    along = (push * ahead).sum(axis=1, keepdims=True)
    across = push - along * ahead
    force = np.linalg.norm(across, axis=1, keepdims=True)
    turned: Floats = np.clip(along, -_SPURT, _SPURT) * ahead
    turned += across * np.minimum(1, _TURN * min(step / RATE, 1.0) * speed / np.maximum(force, 1e-9))
    return turned


def _pace(velocity: Floats) -> Floats:
    speed = np.maximum(np.linalg.norm(velocity, axis=1, keepdims=True), 1e-6)
    push: Floats = 0.8 * (CRUISE - speed) * velocity / speed
    return push


def _walls(place: Floats) -> Floats:
    near = np.maximum(LOW + _WALL - place, 0) - np.maximum(place - (HIGH - _WALL), 0)
    push: Floats = _WALL_PUSH * near
    return push


def _others(place: Floats) -> Floats:
    gap = place[:, None] - place[None]
    far = np.maximum(np.linalg.norm(gap, axis=2, keepdims=True), 1e-6)
    push: Floats = _SHY * (gap / far * np.clip(1 - far / _REACH, 0, 1)).sum(axis=1)
    return push


def _bounded(velocity: Floats) -> Floats:
    """Limit speeds and slopes to those of a fish."""
    ahead = np.hypot(velocity[:, 0], velocity[:, 1])
    slope = _STEEP * np.maximum(ahead, 0.1)
    level = np.column_stack([velocity[:, :2], np.clip(velocity[:, 2], -slope, slope)])
    speed = np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-6)
    bounded: Floats = level * np.clip(speed, *_SPEEDS) / speed
    return bounded


def _landing(place: Floats, velocity: Floats, steps: int) -> Floats:
    """Return the cubic ``(T, P, 3)`` that corrects a path's final error in position and velocity."""
    clock = np.arange(steps + 1) / RATE - steps / RATE
    share = np.clip(1 + clock / _LANDING, 0, 1)[:, None, None]
    cubic: Floats = place * share**2 * (3 - 2 * share) + velocity * _LANDING * share**2 * (share - 1)
    return cubic
