"""What was said last of some frames, in one line: camera by camera, frame by frame, track by track."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from server.service.identity.people import PersonTracker
from server.service.ingest.window_history import HistorySpan
from server.service.view_selection.view_quality_buffer import WindowQuality

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class WindowTracks:
    """All tracks of all cameras in the frames from `first` on, hidden ones included.

    ``said`` has each camera's stretches, ``unsearched`` (C, F) the frames in which it could not have found
    anybody. One frame of one camera is a row.

    Attributes:
        quality: (L,) of each place in line, NaN where hidden.
        row: (L,) which row it is in.
        frame: of each row, from 0 on.
        camera: of each row, by index.
        searched: of each row, whether anybody could have been found.
    """

    def __init__(
        self, said: Sequence[Sequence[HistorySpan[WindowQuality]]], first: int, undetected: NDArray[np.bool_]
    ) -> None:
        self._spans = list(chain.from_iterable(said))
        self._first = first
        camera = np.repeat(np.arange(len(said)), [len(own) for own in said])
        lengths = np.array([it.last - it.first + 1 for it in self._spans], dtype=np.int64)
        self._tracks = np.array([len(it.window.window.keys) for it in self._spans], dtype=np.int64)
        self._camera = camera
        self.camera: Ints = np.repeat(camera, lengths)
        self.frame = _joined([np.arange(it.first - first, it.last - first + 1) for it in self._spans])
        self.searched = ~undetected[self.camera, self.frame]
        self.row: Ints = np.repeat(np.arange(len(self.frame)), np.repeat(self._tracks, lengths))
        self.quality: Floats = np.concatenate([np.zeros(0), *(_quality(it) for it in self._spans)])
        self._begins = np.cumsum(np.concatenate([[0], lengths * self._tracks]))

    def persons(self, people: PersonTracker, everybody: Ints, frames: int) -> Ints:
        """Return the person at each place, (L,): indices into the sorted numbers (K,); -1: none of them.

        A track is in several windows; its numbers in all the frames are asked for once.
        """
        if not len(self.quality) or not len(everybody):
            return np.full(len(self.quality), -1)
        windows = [it.window.window for it in self._spans]
        locals_ = np.concatenate([it.locals for it in windows])
        tracks = np.repeat(self._camera, self._tracks) * (locals_.max() + 1) + locals_
        _, once, back = np.unique(tracks, return_index=True, return_inverse=True)
        keys = list(chain.from_iterable(it.keys for it in windows))
        numbers = people.numbers([keys[at] for at in once.tolist()], self._first, frames)
        persons = np.ascontiguousarray(_over_frames(numbers, everybody).T)
        each = np.split(back, np.cumsum(self._tracks)[:-1])
        return _joined(
            [
                persons[it.first - self._first : it.last - self._first + 1, own].reshape(-1)
                for it, own in zip(self._spans, each, strict=True)
            ]
        )

    def boxes(self, places: Ints) -> Floats:
        """Return the boxes at places in line, (P,) rising: (P, 4) pixels of the site's picture."""
        boxes = np.empty((len(places), 4))
        ends = np.searchsorted(places, self._begins)
        for span, begin, start, end in zip(
            self._spans, self._begins.tolist(), ends.tolist(), ends[1:].tolist(), strict=False
        ):
            own = span.window.window
            frame, track = np.divmod(places[start:end] - begin, max(len(own.keys), 1))
            boxes[start:end] = own.boxes[track, frame + span.first - own.first]
        return boxes

    def terms(self, place: int) -> Floats:
        """Return what the quality at a place in line is made of, (terms,)."""
        number = int(np.searchsorted(self._begins, place, side="right")) - 1
        span = self._spans[number]
        seen = span.window
        frame, track = divmod(place - int(self._begins[number]), seen.quality.shape[1])
        return np.asarray(seen.terms[:, frame + span.first - seen.window.first, track])


def _joined(parts: Sequence[Ints]) -> Ints:
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts])


def _quality(span: HistorySpan[WindowQuality]) -> Floats:
    """Return the quality of a stretch's views in line."""
    seen, first = span.window, span.window.window.first
    return seen.quality[span.first - first : span.last - first + 1].reshape(-1)


def find_indices(numbers: Ints, everybody: Ints) -> Ints:
    """Find numbers (T,) among everybody's (K,), rising: their indices, -1 where they are not among them."""
    if not len(everybody):
        return np.full(numbers.shape, -1)
    at = np.minimum(np.searchsorted(everybody, numbers), len(everybody) - 1)
    return np.where(everybody[at] == numbers, at, -1)


def _over_frames(numbers: Ints, everybody: Ints) -> Ints:
    """Do so for numbers (T, N)."""
    # Hardly any track becomes another person on the way.
    changing = (numbers != numbers[:, :1]).any(axis=1)
    indices = np.repeat(find_indices(numbers[:, 0], everybody)[:, None], numbers.shape[1], axis=1)
    if changing.any():
        indices[changing] = find_indices(numbers[changing], everybody)
    return indices
