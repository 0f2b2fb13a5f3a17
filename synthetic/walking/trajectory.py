"""Trajectories: position, heading and distance walked at any moment of a visit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.walking.route import Route

SAMPLES_PER_SECOND = 20
ROUNDING = 0.32  # seconds: corners are cut, starts and stops softened over this time
TURNING = 0.22  # seconds


@dataclass(frozen=True, slots=True)
class Pose:
    """One person at one instant."""

    x: float  # meters
    y: float
    heading: float  # radians, counter-clockwise from the x axis
    walked: float  # meters since the visit began: the gait's phase
    speed: float  # meters per second


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A visit sampled at `SAMPLES_PER_SECOND`."""

    places: Floats  # (S, 2) meters
    headings: Floats  # (S,) radians, unwrapped
    walked: Floats  # (S,) meters
    speeds: Floats  # (S,) meters per second

    @classmethod
    def along(cls, route: Route, seconds: float, delay: float) -> Trajectory:
        """Sample a route within a visit of `seconds`, beginning after `delay`; wait at its end."""
        times, points, moves = _keyframes(route, delay)
        count = int(seconds * SAMPLES_PER_SECOND) + 2
        clock = np.arange(count) / SAMPLES_PER_SECOND
        places = np.column_stack([np.interp(clock, times, points[:, axis]) for axis in range(2)])
        leg = np.clip(np.searchsorted(times, clock, side="right") - 1, 0, len(moves) - 1)
        headings = np.unwrap(np.unwrap(moves)[leg])
        places = np.column_stack([smooth(places[:, axis], ROUNDING) for axis in range(2)])
        return cls._through(places, smooth(headings, TURNING))

    @classmethod
    def _through(cls, places: Floats, headings: Floats) -> Trajectory:
        steps = np.hypot(*np.diff(places, axis=0, prepend=places[:1]).T)
        return cls(places, headings, np.cumsum(steps), steps * SAMPLES_PER_SECOND)

    def moved(self, places: Floats, every: int) -> Trajectory:
        """Return the same visit through other positions ``(T, 2)``, one per `every` samples."""
        whole, coarse = np.arange(len(self.places)), np.arange(len(places)) * every
        before = self.places[coarse]
        shift = [np.interp(whole, coarse, (places - before)[:, axis]) for axis in range(2)]
        soft = np.column_stack([smooth(axis, 1 / SAMPLES_PER_SECOND) for axis in shift])
        return Trajectory._through(self.places + soft, self.headings)

    def at(self, seconds: float) -> Pose:
        """Return the pose `seconds` into the visit."""
        position = min(max(seconds * SAMPLES_PER_SECOND, 0.0), len(self.walked) - 1.001)
        index = int(position)
        share = position - index
        complement = 1.0 - share
        place = self.places[index] * complement + self.places[index + 1] * share
        return Pose(
            float(place[0]),
            float(place[1]),
            float(self.headings[index] * complement + self.headings[index + 1] * share),
            float(self.walked[index] * complement + self.walked[index + 1] * share),
            float(self.speeds[index] * complement + self.speeds[index + 1] * share),
        )


def _keyframes(route: Route, delay: float) -> tuple[Floats, Floats, Floats]:
    """Return the times and places of keyframes, and the direction faced from each to the next."""
    times, points, facing = [0.0, delay], [route.start, route.start], [0.0]
    for leg in route.legs:
        here = points[-1]
        ahead = math.atan2(leg.end[1] - here[1], leg.end[0] - here[0])
        times.append(times[-1] + math.dist(here, leg.end) / route.pace)
        points.append(leg.end)
        facing.append(ahead)
        if leg.pause > 0:
            look = leg.face or leg.end
            turned = math.atan2(look[1] - leg.end[1], look[0] - leg.end[0]) if leg.face else ahead
            times.append(times[-1] + leg.pause)
            points.append(leg.end)
            facing.append(turned)
    facing[0] = facing[1]
    return np.array(times), np.array(points), np.array(facing)


def smooth(values: Floats, seconds: float) -> Floats:
    """Smooth samples ``(S,)`` over some seconds."""
    radius = int(3 * seconds * SAMPLES_PER_SECOND)
    kernel = cv2.getGaussianKernel(2 * radius + 1, seconds * SAMPLES_PER_SECOND, cv2.CV_64F).ravel()
    smooth: Floats = np.convolve(np.pad(values, radius, mode="edge"), kernel, mode="valid")
    return smooth


def cumulate_to_whole_strides(steps: Floats, stride: float) -> Floats:
    """Return cumulative steps ``(S,)``, stretched to whole strides, so that gaits continue across rounds."""
    walked = np.cumsum(steps) - steps[0]
    strides = float(walked[-1]) / stride
    if strides < 0.25:  # noqa: PLR2004 — hardly a step
        return np.zeros_like(walked)
    stretched: Floats = walked * (max(round(strides), 1) / strides)
    return stretched
