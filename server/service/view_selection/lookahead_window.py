"""The look-ahead window: every view of a person, frame by frame, with its quality."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview import NO_VIEW_COST, GopCosts, VisibleViews, add_inferred_views, add_missed_detections
from bestview.quality import relative_view_quality
from server.service.identity.person_tracker import PersonTracker
from server.service.view_selection.recent_views import RecentViews
from server.service.view_selection.undetected_view_inference import UndetectedViewInference
from server.service.view_selection.undetected_views import UndetectedViews
from server.service.view_selection.view_quality_buffer import ViewQualityBuffer
from server.service.view_selection.window_tracks import WindowTracks, find_indices

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

NO_RECENT_VIEWS = RecentViews()


@dataclass(frozen=True, slots=True)
class LookaheadSettings:
    """How the views of a window are weighed.

    Attributes:
        relative: whether qualities are relative to the best view of a person in the frame.
        decay_frames: frames after a missed detection for about which a person is assumed to be there.
        undetected_weight: of inferred views; 0: there are none.
    """

    relative: bool
    decay_frames: float = 0.0
    undetected_weight: float = 0.0


class LookaheadWindow:
    """The views of all people in the frames from `first` to `last`, as known at one epoch.

    One window serves all GOPs that the epoch decides. ``has(camera, pulse)`` returns whether a camera's frame
    can be shown. ``recent_views`` are the last views before `first`.
    """

    def __init__(
        self,
        cameras: Sequence[str],
        quality_buffer: ViewQualityBuffer,
        people: PersonTracker,
        has: Callable[[str, int], bool],
        first: int,
        last: int,
        settings: LookaheadSettings,
        recent_views: RecentViews = NO_RECENT_VIEWS,
        inference: UndetectedViewInference | None = None,
    ) -> None:
        self.cameras, self.first = cameras, first
        self.numbers: Ints = np.array(people.known, dtype=np.int64)
        """(K,) the people's numbers, rising."""
        first_seen = people.registry.first_seen
        self._first_seen = np.fromiter(
            (first_seen[number] for number in self.numbers.tolist()), np.int64, len(self.numbers)
        )
        pulses, count = range(first, last + 1), len(self.numbers)
        undetected = np.array([people.undetected.over(camera, first, len(pulses)) for camera in cameras])
        tracks = WindowTracks(
            [quality_buffer.over(camera, first, last) for camera in cameras], first, undetected
        )
        shown = np.array([[has(camera, pulse) for camera in cameras] for pulse in pulses], dtype=np.bool_)
        numbers: Ints = np.array(people.registry.all_numbers, dtype=np.int64)
        everyone, own_indices = (
            tracks.persons(people, numbers, len(pulses)),
            find_indices(numbers, self.numbers),
        )
        self.inferred_views = (
            UndetectedViews.empty()
            if inference is None or not settings.undetected_weight
            else inference.infer(tracks, everyone, len(pulses))
        )
        """For the people of all shards."""
        person = np.append(own_indices, -1)[everyone]
        self._tracks, self._indices = tracks, _countable_views(tracks, person, shown, count)
        self.quality: Floats = tracks.quality[self._indices]
        """(R,) the quality of each view by itself."""
        row, person = tracks.row[self._indices], person[self._indices]
        frame, quality = tracks.frame[row], np.minimum(self.quality, 1.0)
        detected = (frame * len(cameras) + tracks.camera[row]) * count + person
        self.undetected = inferred = self.inferred_views.of(
            own_indices, count, shown, detected, settings.undetected_weight
        )
        """Inferred views of this shard's people whom the camera does not detect."""
        inferred_quality = np.minimum(inferred.quality, 1.0)
        if settings.relative:
            moment = np.concatenate([frame * count + person, inferred.frame * count + inferred.person])
            both = relative_view_quality(
                np.concatenate([quality, inferred_quality]), moment, len(pulses) * count
            )
            quality, inferred_quality = both[: len(quality)], both[len(quality) :]
        self.views = VisibleViews(frame, tracks.camera[row], person, quality, shown, count)
        self.before = recent_views.of(self.numbers, len(cameras), first)
        """Each person's last views before the first frame."""
        missed = add_missed_detections(self.views, self.before, settings.decay_frames)
        self.effective_views = add_inferred_views(
            missed, inferred.frame, inferred.camera, inferred.person, inferred_quality
        )
        """Detected views, those assumed after missed detections, and those inferred from other cameras."""

    def seen_since(self, last: int) -> Mask:
        """Return who was seen in or before a frame, (K,)."""
        return np.asarray(self._first_seen <= last)

    def recent_views(self, pulse: int) -> RecentViews:
        """Return the last views before a pulse, for the next window."""
        return RecentViews.after(self.numbers, self.before, self.views, self.first, pulse)

    def terms(self, view: int) -> Floats:
        """Return the quality terms of a view, (terms,)."""
        return self._tracks.terms(int(self._indices[view]))

    def part(self, first: int, frames: int, of: Mask) -> LookaheadPart:
        """Return a part of the window: some of its frames, and the people of the mask (K,)."""
        return LookaheadPart(self, first - self.first, frames, np.flatnonzero(of))


@dataclass(frozen=True, slots=True, eq=False)
class LookaheadPart:
    """Some frames of a look-ahead window, for some of the people.

    Attributes:
        window: the whole window.
        first: its first frame, counted from the window's.
        frames: N, the number of frames.
        people: (K,) indices into the window's people, rising.
    """

    window: LookaheadWindow
    first: int
    frames: int
    people: Ints

    @property
    def numbers(self) -> Ints:
        """(K,) the people's numbers, rising."""
        return self.window.numbers[self.people]

    def gops(self, starts: Mask, weight: Floats, *, mark_hidden: bool) -> GopCosts:
        """Return the costs of the GOPs that begin at the mask's frames (N,), frames weighted by (N,)."""
        gops = self.window.effective_views.gops(self.first, starts, weight, mark_hidden=mark_hidden)
        return gops if len(self.people) == len(self.window.numbers) else gops.for_people(self.people)

    def views(self, number: int) -> Ints:
        """Return one person's views, (R,) indices into the window's.

        Raises:
            KeyError: the person is not in this part.
        """
        return self._rows(self.window.views, number)

    def undetected(self, number: int) -> Ints:
        """Return one person's inferred views, (V,) indices into the window's.

        Raises:
            KeyError: the person is not in this part.
        """
        return self._rows(self.window.undetected, number)

    def frame_costs(self, number: int) -> Floats:
        """Return one person's c(n, b), (N, C); infinite where a camera cannot be shown.

        Raises:
            KeyError: the person is not in this part.
        """
        views, rows = self.window.effective_views, self._rows(self.window.effective_views, number)
        cost = np.where(views.available[self.first : self.first + self.frames], NO_VIEW_COST, np.inf)
        cost[views.frame[rows] - self.first, views.camera[rows]] -= views.quality[rows]
        return cost

    def _rows(self, views: VisibleViews | UndetectedViews, number: int) -> Ints:
        person = self.people[self.numbers == number]
        if not person.size:
            raise KeyError(number)
        inside = (views.frame >= self.first) & (views.frame < self.first + self.frames)
        return np.flatnonzero(inside & (views.person == person[0]))


def _countable_views(tracks: WindowTracks, person: Ints, shown: Mask, people: int) -> Ints:
    """Return the flat indices of the tracks' views that count, (R,), rising.

    Of several tracks that show one person in one frame of a camera the first counts.

    Args:
        tracks: of the window.
        person: (L,) who each view shows, below `people`; -1: nobody.
        shown: (N, C) whether a camera's frame can be shown.
        people: their number.
    """
    visible = np.flatnonzero((tracks.quality >= 0.0) & (person >= 0))
    cell = (tracks.frame * shown.shape[1] + tracks.camera)[tracks.row[visible]]
    counts = _first_of_each(cell * people + person[visible], shown.size * people)
    counts &= shown.reshape(-1)[cell] & (tracks.quality[visible] > 0.0)
    return visible[counts]


def _first_of_each(values: Ints, count: int) -> Mask:
    """Return which values, all below `count`, occur for the first time: the first of two tracks counts."""
    places = np.arange(len(values))
    first_place = np.empty(count, dtype=np.intp)
    first_place[values[::-1]] = places[::-1]  # the first one is written last
    return np.asarray(first_place[values] == places)
