"""What is ahead: every view that shows somebody, frame by frame, and what it is worth."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from bestview import NO_VIEW_COST, Gops, SeenViews
from bestview.quality import compared_views
from server.view.history import Stretch
from server.view.people import People
from server.view.sight import SeenWindow, Sight

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]


class Outlook:
    """The views of all people in the frames from `first` to `last`, as known at one epoch.

    One outlook serves all GOPs that the epoch decides. ``has(camera, pulse)`` tells whether a camera's frame
    can be shown. Windows are read as they are, one after the other: camera by camera, frame by frame, track
    by track. Where a view is in this line is its place.
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
        self.cameras, self.first = cameras, first
        self.numbers: Ints = np.array(people.known, dtype=np.int64)
        """(K,) everybody's, rising."""
        said = [sight.over(camera, first, last) for camera in cameras]
        self._stretches = list(chain.from_iterable(said))
        frames = last - first + 1
        pulses = range(first, last + 1)
        shown = np.array([[has(camera, it) for camera in cameras] for it in pulses], dtype=np.bool_)
        cell = _line(_cells(it, column, first, len(cameras)) for column, own in enumerate(said) for it in own)
        person = _line(
            chain.from_iterable(_persons(people, self.numbers, own, first, frames) for own in said)
        )
        quality = np.concatenate([np.zeros(0), *(_quality(it) for it in self._stretches)])
        there = np.flatnonzero((quality >= 0.0) & (person >= 0))
        seen = cell[there] * len(self.numbers) + person[there]
        there = there[_first_of_each(seen, shown.size * len(self.numbers))]
        there = there[shown.reshape(-1)[cell[there]] & (quality[there] > 0.0)]
        frame, camera = np.divmod(cell[there], len(cameras))
        person, self.quality = person[there], quality[there]
        worth = np.clip(self.quality, 0.0, 1.0)
        if relative:
            worth = compared_views(worth, frame * len(self.numbers) + person, frames * len(self.numbers))
        self.views = SeenViews(frame, camera, person, worth, shown, len(self.numbers))
        self._places = there
        self._begins = np.cumsum([0, *(_size(it) for it in self._stretches)])

    def terms(self, view: int) -> Floats:
        """Give what the quality of a view is made of, (terms,)."""
        place = int(self._places[view])
        number = int(np.searchsorted(self._begins, place, side="right")) - 1
        stretch = self._stretches[number]
        seen = stretch.window
        frame, track = divmod(place - int(self._begins[number]), seen.quality.shape[1])
        return np.asarray(seen.terms[:, frame + stretch.first - seen.window.first, track])

    def part(self, first: int, frames: int, of: Mask) -> Part:
        """Give the outlook on some of its frames, for the people of the mask (K,)."""
        return Part(self, first - self.first, frames, np.flatnonzero(of))


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Some frames of an outlook, for some of the people.

    Attributes:
        outlook: of which it is a part.
        first: frame of the outlook at which it begins.
        frames: N of them.
        people: (K,) indices into the outlook's people, rising.
    """

    outlook: Outlook
    first: int
    frames: int
    people: Ints

    @property
    def numbers(self) -> Ints:
        """(K,) the people's numbers, rising."""
        return self.outlook.numbers[self.people]

    def gops(self, starts: Mask, weight: Floats) -> Gops:
        """Give what the GOPs cost that begin where the mask (N,) says, each frame by its weight (N,)."""
        gops = self.outlook.views.gops(self.first, starts, weight)
        return gops if len(self.people) == len(self.outlook.numbers) else gops.of(self.people)

    def views(self, number: int) -> Ints:
        """Give one person's views, (R,) indices into the outlook's.

        Raises:
            KeyError: this part is not about that person.
        """
        person = self.people[self.numbers == number]
        if not person.size:
            raise KeyError(number)
        views = self.outlook.views
        inside = (views.frame >= self.first) & (views.frame < self.first + self.frames)
        return np.flatnonzero(inside & (views.person == person[0]))

    def cost(self, number: int) -> Floats:
        """Give one person's c(n, b), (N, C); infinite where a camera cannot be shown.

        Raises:
            KeyError: this part is not about that person.
        """
        views, rows = self.outlook.views, self.views(number)
        cost = np.where(views.shown[self.first : self.first + self.frames], NO_VIEW_COST, np.inf)
        cost[views.frame[rows] - self.first, views.camera[rows]] -= views.worth[rows]
        return cost


def _line(parts: Iterable[Ints]) -> Ints:
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts])


def _size(stretch: Stretch[SeenWindow]) -> int:
    return (stretch.last - stretch.first + 1) * len(stretch.window.window.keys)


def _quality(stretch: Stretch[SeenWindow]) -> Floats:
    """Give the quality of a stretch's views in line."""
    seen, first = stretch.window, stretch.window.window.first
    return seen.quality[stretch.first - first : stretch.last - first + 1].reshape(-1)


def _cells(stretch: Stretch[SeenWindow], camera: int, first: int, cameras: int) -> Ints:
    """Give frame and camera of a stretch's views in line, as one number each."""
    frames = np.arange(stretch.first - first, stretch.last - first + 1)
    return np.repeat(frames * cameras + camera, stretch.window.quality.shape[1])


def _persons(
    people: People, everybody: Ints, stretches: Sequence[Stretch[SeenWindow]], first: int, frames: int
) -> list[Ints]:
    """Give the persons (by index; -1: none of them) of one camera's views in line, stretch by stretch.

    A track is in most windows; it is asked for once.
    """
    if not stretches or not everybody.size:
        return [np.full(_size(it), -1) for it in stretches]
    keys = list(chain.from_iterable(it.window.window.keys for it in stretches))
    locals_ = np.concatenate([it.window.window.locals for it in stretches])
    _, once, rows = np.unique(locals_, return_index=True, return_inverse=True)
    persons = _indices(people.numbers([keys[at] for at in once.tolist()], first, frames), everybody)
    ends = np.cumsum([len(it.window.window.keys) for it in stretches])
    return [
        persons[own, it.first - first : it.last - first + 1].T.reshape(-1)
        for own, it in zip(np.split(rows, ends[:-1]), stretches, strict=True)
    ]


def _indices(numbers: Ints, everybody: Ints) -> Ints:
    """Find numbers (T, N) among everybody's (K,), rising: their indices, -1 where they are not among them."""

    def found(values: Ints) -> Ints:
        at = np.minimum(np.searchsorted(everybody, values), len(everybody) - 1)
        return np.where(everybody[at] == values, at, -1)

    # Hardly any track becomes another person on the way.
    changing = (numbers != numbers[:, :1]).any(axis=1)
    indices = np.repeat(found(numbers[:, 0])[:, None], numbers.shape[1], axis=1)
    if changing.any():
        indices[changing] = found(numbers[changing])
    return indices


def _first_of_each(values: Ints, count: int) -> Mask:
    """Tell which values, all below `count`, are there for the first time: of two tracks one counts."""
    places = np.arange(len(values))
    owner = np.empty(count, dtype=np.int64)
    owner[values[::-1]] = places[::-1]  # written last, the first one stays
    return np.asarray(owner[values] == places)
