"""A shoal of fish: positions, headings and tail beats at any moment.

Time is cut into rounds that begin and end at waypoints: places and velocities that are a pure function of
the seed and the round's number. So any moment can be drawn directly, in any process.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.tank.steering import CRUISE, HIGH, LOW, RATE, STRAIGHT, Waypoints, swim_between
from synthetic.walking.trajectory import cumulate_to_whole_strides

ROUND = 32.0  # seconds
_DRAWS = 60  # candidate positions, of which a fish uses the one farthest from the others
_PASSING = (
    -STRAIGHT,
    -STRAIGHT / 2,
    0.0,
    STRAIGHT / 3,
)  # seconds around a waypoint in which a fish keeps clear of others
_BEFORE = 10_000  # added to numbers of rounds in seeds, which cannot be negative
_BEAT = 0.42  # meters swum per beat of the tail
_APART = 1.4  # distance between two fish in meters beyond which more has no value
_RING = 0.95  # meters: all start on a circle around the first camera's axis, swimming towards it
_TURNING = 0.2  # seconds over which a head follows its path
_EASE = 0.8  # seconds at a round's ends in which bodies straighten


@dataclass(frozen=True, slots=True)
class ShoalState:
    """All fish at one instant."""

    places: Floats  # (P, 3) meters
    ahead: Floats  # (P, 3) unit vectors: where the heads point
    beats: Floats  # (P,) of the tail, counted
    vigour: Floats  # (P,) how far the tail swings, 1 when cruising
    turn_rates: Floats  # (P,) radians per second: how fast a fish turns to its left


@dataclass(frozen=True, slots=True)
class _Round:
    places: Floats  # (T, P, 3)
    ahead: Floats  # (T, P, 3)
    beats: Floats  # (T, P)
    vigour: Floats  # (T, P)
    turn_rates: Floats  # (T, P)


class Shoal:
    """Fish that swim endlessly; fish 0 is object 1."""

    def __init__(self, count: int, seed: int) -> None:
        self._count = count
        self._seed = seed
        self._round = lru_cache(maxsize=3)(self._swim)

    def at(self, seconds: float) -> ShoalState:
        """Return the state of all fish at a moment of the scene."""
        number = int(seconds // ROUND)
        path = self._round(number)
        position = (seconds - number * ROUND) * RATE
        index = min(int(position), len(path.places) - 2)
        share = position - index
        places, ahead, beats, vigour, turn_rates = (
            part[index] * (1 - share) + part[index + 1] * share
            for part in (path.places, path.ahead, path.beats, path.vigour, path.turn_rates)
        )
        return ShoalState(places, _unit(ahead), beats, vigour, turn_rates)

    def _waypoints(self, number: int) -> Waypoints:
        if number == 0:
            return _ring(self._count)
        rng = np.random.default_rng([self._seed, 0xF154, number + _BEFORE])
        path = np.array(_PASSING)[:, None]
        places, ahead = np.empty((self._count, 3)), np.empty((self._count, 3))
        for fish in range(self._count):
            spots, pace = _spots(rng)
            paths = spots[:, None] + path * pace[:, None]  # (_DRAWS, moments, 3)
            others = places[:fish, None] + path * ahead[:fish, None]
            gaps = np.linalg.norm(paths[:, None] - others[None], axis=3)
            inner = np.minimum(np.minimum(paths - LOW, HIGH - paths), 0).sum(axis=(1, 2))
            best = int((gaps.min(axis=(1, 2), initial=_APART) + inner).argmax())
            places[fish], ahead[fish] = spots[best], pace[best]
        return Waypoints(places, ahead)

    def _swim(self, number: int) -> _Round:
        rng = np.random.default_rng([self._seed, 0x5417, number + _BEFORE])
        start, end = self._waypoints(number), self._waypoints(number + 1)
        places = swim_between(rng, start, end, ROUND)
        velocities = np.gradient(places, 1 / RATE, axis=0)
        velocities[0], velocities[-1] = start.velocities, end.velocities
        clock = np.arange(len(places)) / RATE
        ease = np.clip(np.minimum(clock, ROUND - clock) / _EASE, 0, 1)
        velocities = _steady(velocities, ease)
        speeds = np.linalg.norm(velocities, axis=2)
        steps = np.linalg.norm(np.diff(places, axis=0, prepend=places[:1]), axis=2)
        beats = np.array([cumulate_to_whole_strides(fish, _BEAT) / _BEAT for fish in steps.T]).T.reshape(
            speeds.shape
        )
        turns = np.unwrap(np.arctan2(velocities[..., 1], velocities[..., 0]), axis=0)
        turn_rates = np.clip(np.gradient(turns, 1 / RATE, axis=0), -2.5, 2.5) * ease[:, None]
        return _Round(places, velocities, beats, np.clip(speeds / CRUISE, 0.4, 1.5), turn_rates)


def _spots(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Draw candidates ``(_DRAWS, 3)`` for a fish's place and velocity at a waypoint."""
    turn = rng.uniform(0, 2 * np.pi, _DRAWS)
    ahead = np.column_stack([np.cos(turn), np.sin(turn), rng.uniform(-0.15, 0.15, _DRAWS)])
    return rng.uniform(LOW + 0.3, HIGH - 0.3, (_DRAWS, 3)), CRUISE * _unit(ahead)


def _ring(count: int) -> Waypoints:
    """Return waypoints on a circle, heads towards the first camera."""
    angles = 2 * np.pi * np.arange(count) / max(count, 1) + np.pi / 2
    middle = (LOW + HIGH) / 2
    spread = _RING * np.column_stack([np.cos(angles) * 1.5, np.zeros(count), np.sin(angles) * 0.9])
    return Waypoints(middle + spread, np.tile([0.0, -CRUISE, 0.0], (count, 1)))


def _steady(velocities: Floats, ease: Floats) -> Floats:
    """Smooth velocities ``(T, P, 3)``: heads turn more smoothly than paths, except at a round's ends."""
    flat = velocities.reshape(len(velocities), -1)
    soft = cv2.GaussianBlur(flat, (1, 13), sigmaX=1, sigmaY=_TURNING * RATE, borderType=cv2.BORDER_REPLICATE)
    steady: Floats = velocities + ease[:, None, None] * (soft - flat).reshape(velocities.shape)
    return steady


def _unit(vectors: Floats) -> Floats:
    unit: Floats = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
    return unit
