"""What is ahead: every view's cost for every person, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.quality import compared, view_cost
from server.view.people import People
from server.view.sight import SeenFrame, SeenWindow, Sight

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Numbered:
    """A camera's frame, and the people's numbers of the tracks in it, (T,); -1: nobody's yet."""

    frame: SeenFrame
    numbers: Ints


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Some frames of an outlook.

    Attributes:
        cameras: their names; C of them.
        numbers: (K,) the people's, rising.
        cost: (K, N, C) c(n, b); infinite where a camera cannot be shown.
        frames: (N) by (C) what is known of each camera's frame; None: nothing.
    """

    cameras: Sequence[str]
    numbers: Ints
    cost: Floats
    frames: Sequence[Sequence[Numbered | None]]


class Outlook:
    """The costs of all people's views in the frames from `first` to `last`, as known at one epoch.

    One outlook serves all GOPs that the epoch decides. ``has(camera, pulse)`` tells whether a camera's frame
    can be shown.
    """

    def __init__(
        self,
        cameras: Sequence[str],
        sight: Sight,
        people: People,
        has: Callable[[str, int], bool],
        first: int,
        last: int,
        *,
        relative: bool,
    ) -> None:
        self._cameras, self._first = cameras, first
        self.numbers: Ints = np.array(people.known, dtype=np.int64)
        """(K,) everybody's, rising."""
        pulses = range(first, last + 1)
        numbers_of = _Numbers(people)
        self._frames = [[numbers_of.frame(sight.at(camera, pulse)) for camera in cameras] for pulse in pulses]
        shown = np.array([[has(camera, pulse) for camera in cameras] for pulse in pulses], dtype=np.bool_)
        # Frames, cameras, objects: what the program reads fastest.
        quality = np.zeros((len(pulses), len(cameras), len(self.numbers)))
        self._fill(quality)
        quality[~shown] = 0.0
        self._cost = view_cost(compared(quality, axis=1) if relative else quality)
        self._cost[~shown] = np.inf

    def part(self, first: int, frames: int, of: NDArray[np.bool_]) -> Part:
        """Give the outlook on some of its frames, for the people of the mask (K,)."""
        rows = slice(first - self._first, first - self._first + frames)
        cost = self._cost[rows] if of.all() else self._cost[rows][:, :, of]
        return Part(self._cameras, self.numbers[of], cost.transpose(2, 0, 1), self._frames[rows])

    def _fill(self, views: Floats) -> None:
        """Write the quality of every view that is there into (frames, cameras, objects)."""
        cells = [
            ((place * len(self._cameras)) + column, numbered)
            for place, row in enumerate(self._frames)
            for column, numbered in enumerate(row)
            if numbered is not None and numbered.numbers.size
        ]
        if not cells or not self.numbers.size:
            return
        numbers = np.concatenate([it.numbers for _, it in cells])
        quality = np.concatenate([it.frame.window.quality[it.frame.place] for _, it in cells])
        cell = np.repeat([cell for cell, _ in cells], [it.numbers.size for _, it in cells])
        person = np.minimum(np.searchsorted(self.numbers, numbers), len(self.numbers) - 1)
        there = np.flatnonzero((self.numbers[person] == numbers) & ~np.isnan(quality))
        # Of two tracks of one camera with one number the first counts: written last, it stays.
        there = there[::-1]
        views.reshape(-1, len(self.numbers))[cell[there], person[there]] = quality[there]


class _Numbers:
    """The people's numbers of each window's tracks, looked up once however many frames it is asked for."""

    def __init__(self, people: People) -> None:
        self._people = people
        self._known: dict[int, tuple[SeenWindow, Ints]] = {}

    def frame(self, frame: SeenFrame | None) -> Numbered | None:
        if frame is None:
            return None
        window = frame.window
        if id(window) not in self._known:
            frames = len(window.quality)
            self._known[id(window)] = window, self._people.numbers(window.keys, window.first, frames)
        return Numbered(frame, self._known[id(window)][1][:, frame.place])
