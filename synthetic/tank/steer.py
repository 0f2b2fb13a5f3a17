"""Swimming about: random ways in three dimensions that keep clear of each other and of the walls."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.walking.collision_avoidance import give_way

RATE = 10  # samples a second
LOW = np.array([0.55, 0.55, 0.5])  # metres: where fish swim, corner to corner
HIGH = np.array([5.45, 4.45, 2.5])
CRUISE = 0.55  # metres per second
_SPEEDS = (0.28, 0.95)  # metres per second
_STEEP = 0.45  # of the speed ahead is the most that a fish climbs or dives
_WHIM = np.array([0.85, 0.85, 0.22])  # metres per second squared
_WHIM_SECONDS = 0.7  # that a whim lasts
_WALL = 0.7  # metres before the end of the water at which a fish turns away
_WALL_PUSH = 3.2  # metres per second squared and metre
_REACH = 1.35  # metres within which fish make way for each other
_SHY = 6.0  # metres per second squared, where two would be in one place
_FORESEE = 0.45  # seconds that they look ahead
_SPURT = 0.6  # metres per second squared
_TURN = 1.9  # radians per second, at most
STRAIGHT = 3.0  # seconds before a mark that are swum straight towards it
_KEEN = 2.5  # per second: how soon a fish swims as it wants to
_CLOSING = 0.9  # seconds in which it would be where it wants to be
_CLEAR = 0.55  # metres between two fish, at least, that land
_TRIALS = 4  # until all fish end
_NEAR = 0.75  # metres from their marks
_LANDING = 4.0  # seconds before the end over which what is still missing is made up for


@dataclass(frozen=True, slots=True)
class Mark:
    """Where fish are, and where they are going, at a moment that all ways pass through."""

    places: Floats  # (P, 3) metres
    velocities: Floats  # (P, 3) metres per second


def swim(rng: np.random.Generator, start: Mark, end: Mark, seconds: float) -> Floats:
    """Swim from one mark to another: ``(T, P, 3)`` metres, `RATE` samples a second, both ends included."""
    trials = []
    for _ in range(_TRIALS):
        trials.append(_try(rng, start, end, seconds))
        if trials[-1].missed < _NEAR:
            break
    best = min(trials, key=lambda trial: trial.missed)
    way = best.way + _landing(end.places - best.way[-1], end.velocities - best.velocities, len(best.way) - 1)
    last = slice(-round(2 * _LANDING * RATE), None)
    keep = np.full((way.shape[1], way.shape[1]), _CLEAR)
    way[last] = give_way(way[last].transpose(1, 0, 2), keep, RATE).transpose(1, 0, 2)
    return way


@dataclass(frozen=True, slots=True)
class _Trial:
    way: Floats  # (T, P, 3) metres
    velocities: Floats  # (P, 3) metres per second, at its end
    missed: float  # metres from the mark, of the fish that ends furthest from its own


def _try(rng: np.random.Generator, start: Mark, end: Mark, seconds: float) -> _Trial:
    """Steer from one mark for another; what is missing at the end is a metre at most, as a rule."""
    steps = round(seconds * RATE)
    whims = _whims(rng, steps, len(start.places))
    place, velocity = start.places.copy(), start.velocities.copy()
    way = np.empty((steps + 1, *place.shape))
    way[0] = place
    for step in range(steps):
        ahead = place + _FORESEE * velocity
        home, urgent = _home(place, velocity, end, seconds - step / RATE)
        push = _walls(ahead) + _others(ahead) + urgent * home
        push += (1 - urgent) * (whims[step] + _pace(velocity))
        velocity = _bounded(velocity + _agile(push, velocity, step) / RATE)
        place = place + velocity / RATE
        way[step + 1] = place
    missed = float(np.linalg.norm(end.places - place, axis=1).max(initial=0.0))
    return _Trial(way, velocity, missed)


def _whims(rng: np.random.Generator, steps: int, fish: int) -> Floats:
    """Draw pushes ``(steps, P, 3)`` that change smoothly."""
    raw = rng.standard_normal((steps, fish * 3))
    sigma = _WHIM_SECONDS * RATE
    soft = cv2.GaussianBlur(raw, (1, 2 * int(3 * sigma) + 1), sigmaX=1, sigmaY=sigma)
    rise = np.clip(np.arange(steps) / (_WHIM_SECONDS * 2 * RATE), 0, 1)[:, None, None]
    whims: Floats = rise * soft.reshape(steps, fish, 3) / max(float(soft.std()), 1e-9) * _WHIM
    return whims


def _home(place: Floats, velocity: Floats, end: Mark, left: float) -> tuple[Floats, Floats]:
    """Give the pushes ``(P, 3)`` towards a mark, and how much they matter ``(P, 1)``: 0 with time to spare.

    A fish makes for a point before its mark, and swims the last seconds with what passes the mark on time.
    """
    straight = min(left, STRAIGHT)
    gap = end.places - end.velocities * straight - place
    far = np.linalg.norm(gap, axis=1, keepdims=True)
    wanted = gap * np.minimum(1 / _CLOSING, _SPEEDS[1] / np.maximum(far, 1e-6))
    if left <= STRAIGHT:
        return _KEEN * (wanted + end.velocities - velocity), np.ones_like(far)
    need = far / (0.6 * CRUISE * (left - STRAIGHT + 0.1))
    urgent: Floats = np.clip(need, 0, 1) ** 4
    return _KEEN * (wanted - velocity), urgent


def _agile(push: Floats, velocity: Floats, step: int) -> Floats:
    """Cut pushes ``(P, 3)`` down to how fast a fish turns and speeds up; at first it swims straight on."""
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
    """Keep speeds and slopes within what a fish does."""
    ahead = np.hypot(velocity[:, 0], velocity[:, 1])
    slope = _STEEP * np.maximum(ahead, 0.1)
    level = np.column_stack([velocity[:, :2], np.clip(velocity[:, 2], -slope, slope)])
    speed = np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-6)
    bounded: Floats = level * np.clip(speed, *_SPEEDS) / speed
    return bounded


def _landing(place: Floats, velocity: Floats, steps: int) -> Floats:
    """Give the cubic ``(T, P, 3)`` that ends with what a way misses its mark by, in place and velocity."""
    clock = np.arange(steps + 1) / RATE - steps / RATE
    share = np.clip(1 + clock / _LANDING, 0, 1)[:, None, None]
    cubic: Floats = place * share**2 * (3 - 2 * share) + velocity * _LANDING * share**2 * (share - 1)
    return cubic
