"""What is ahead: every view that shows somebody, frame by frame, and what it is worth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview import NO_VIEW_COST, GopCosts, VisibleViews, add_inferred_views, add_missed_detections
from bestview.quality import relative_view_quality
from server.service.identity.people import PersonTracker
from server.service.view_selection.cross_view_inference import CrossViewInference
from server.service.view_selection.recent_views import RecentViews
from server.service.view_selection.undetected_views import UndetectedViews
from server.service.view_selection.view_quality_buffer import ViewQualityBuffer
from server.service.view_selection.window_line import WindowTracks, find_indices

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

NOTHING = RecentViews()


class LookaheadWindow:
    """The views of all people in the frames from `first` to `last`, as known at one epoch.

    One outlook serves all GOPs that the epoch decides. ``has(camera, pulse)`` tells whether a camera's frame
    can be shown. ``lately`` is how everybody was seen before, and `lasts` for how many frames who is missed
    is taken to be still there.
    """

    def __init__(
        self,
        cameras: Sequence[str],
        sight: ViewQualityBuffer,
        people: PersonTracker,
        has: Callable[[str, int], bool],
        first: int,
        last: int,
        *,
        relative: bool,
        lately: RecentViews = NOTHING,
        lasts: float = 0.0,
        elsewhere: CrossViewInference | None = None,
        undetected_weight: float = 0.0,
    ) -> None:
        self.cameras, self.first = cameras, first
        self.numbers: Ints = np.array(people.known, dtype=np.int64)
        """(K,) everybody's, rising."""
        pulses, everybody = range(first, last + 1), len(self.numbers)
        undetected = np.array([people.undetected.over(camera, first, len(pulses)) for camera in cameras])
        line = WindowTracks([sight.over(camera, first, last) for camera in cameras], first, undetected)
        shown = np.array([[has(camera, it) for camera in cameras] for it in pulses], dtype=np.bool_)
        numbers: Ints = np.array(people.registry.everybody, dtype=np.int64)
        anybody, mine = line.persons(people, numbers, len(pulses)), find_indices(numbers, self.numbers)
        self.looked = (
            UndetectedViews.nobody() if elsewhere is None else elsewhere.look(line, anybody, len(pulses))
        )
        """For all people, also those whom another service decides for."""
        person = np.append(mine, -1)[anybody]
        there = np.flatnonzero((line.quality >= 0.0) & (person >= 0))
        row, person = line.row[there], person[there]
        cell = (line.frame * len(cameras) + line.camera)[row]
        counts = _first_of_each(cell * everybody + person, shown.size * everybody)
        counts &= shown.reshape(-1)[cell] & (line.quality[there] > 0.0)
        self._line, self._places = line, there[counts]
        self.quality: Floats = line.quality[self._places]
        """(R,) of each view by itself."""
        row, person = row[counts], person[counts]
        frame, worth = line.frame[row], np.minimum(self.quality, 1.0)
        found = (frame * len(cameras) + line.camera[row]) * everybody + person
        self.undetected = other = self.looked.of(mine, everybody, shown, found, undetected_weight)
        """This outlook's people's views that are worth something though the camera does not find them."""
        extra = np.minimum(other.quality, 1.0)
        if relative:
            moment = np.concatenate([frame * everybody + person, other.frame * everybody + other.person])
            both = relative_view_quality(np.concatenate([worth, extra]), moment, len(pulses) * everybody)
            worth, extra = both[: len(worth)], both[len(worth) :]
        self.views = VisibleViews(frame, line.camera[row], person, worth, shown, everybody)
        self.before = lately.of(self.numbers, len(cameras), first)
        """How everybody was seen before the first frame."""
        missed = add_missed_detections(self.views, self.before, lasts)
        self.taken = add_inferred_views(missed, other.frame, other.camera, other.person, extra)
        """The views, and those that are taken to be there though somebody was missed, or is not found."""

    def lately(self, pulse: int) -> RecentViews:
        """Return how everybody was seen before a pulse, for the next outlook."""
        return RecentViews.after(self.numbers, self.before, self.views, self.first, pulse)

    def terms(self, view: int) -> Floats:
        """Return what the quality of a view is made of, (terms,)."""
        return self._line.terms(int(self._places[view]))

    def part(self, first: int, frames: int, of: Mask) -> LookaheadPart:
        """Return the outlook on some of its frames, for the people of the mask (K,)."""
        return LookaheadPart(self, first - self.first, frames, np.flatnonzero(of))


@dataclass(frozen=True, slots=True, eq=False)
class LookaheadPart:
    """Some frames of a look-ahead window, for some of the people.

    Attributes:
        outlook: of which it is a part.
        first: frame of the outlook at which it begins.
        frames: N of them.
        people: (K,) indices into the outlook's people, rising.
    """

    outlook: LookaheadWindow
    first: int
    frames: int
    people: Ints

    @property
    def numbers(self) -> Ints:
        """(K,) the people's numbers, rising."""
        return self.outlook.numbers[self.people]

    def gops(self, starts: Mask, weight: Floats, *, blind: bool) -> GopCosts:
        """Return what the GOPs cost that begin where the mask (N,) says, each frame by its weight (N,)."""
        gops = self.outlook.taken.gops(self.first, starts, weight, mark_empty=blind)
        return gops if len(self.people) == len(self.outlook.numbers) else gops.for_people(self.people)

    def views(self, number: int) -> Ints:
        """Return one person's views, (R,) indices into the outlook's.

        Raises:
            KeyError: this part is not about that person.
        """
        return self._rows(self.outlook.views, number)

    def undetected(self, number: int) -> Ints:
        """Return one person's views in which they are not found, (V,) indices into the outlook's.

        Raises:
            KeyError: this part is not about that person.
        """
        return self._rows(self.outlook.undetected, number)

    def cost(self, number: int) -> Floats:
        """Return one person's c(n, b), (N, C); infinite where a camera cannot be shown.

        Raises:
            KeyError: this part is not about that person.
        """
        views, rows = self.outlook.taken, self._rows(self.outlook.taken, number)
        cost = np.where(views.available[self.first : self.first + self.frames], NO_VIEW_COST, np.inf)
        cost[views.frame[rows] - self.first, views.camera[rows]] -= views.quality[rows]
        return cost

    def _rows(self, views: VisibleViews | UndetectedViews, number: int) -> Ints:
        person = self.people[self.numbers == number]
        if not person.size:
            raise KeyError(number)
        inside = (views.frame >= self.first) & (views.frame < self.first + self.frames)
        return np.flatnonzero(inside & (views.person == person[0]))


def _first_of_each(values: Ints, count: int) -> Mask:
    """Return which values, all below `count`, are there for the first time: of two tracks one counts."""
    places = np.arange(len(values))
    owner = np.empty(count, dtype=np.intp)
    owner[values[::-1]] = places[::-1]  # written last, the first one stays
    return np.asarray(owner[values] == places)
