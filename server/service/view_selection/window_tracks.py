"""The tracks of a look-ahead window as flat arrays: camera by camera, frame by frame, track by track."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from server.service.identity.person_tracker import PersonTracker
from server.service.ingest.window_history import HistorySpan
from server.service.view_selection.view_quality_buffer import WindowQuality

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class WindowTracks:
    """All tracks of all cameras in the frames from `first` on, hidden ones included.

    ``spans`` are each camera's newest windows, ``undetected`` (C, F) the frames without detection. A frame of
    a camera is a row; L is the number of tracks in all rows.

    Attributes:
        quality: (L,) NaN where hidden.
        row: (L,) index of the row.
        frame: of each row, counted from `first`.
        camera: of each row, by index.
        has_detection: of each row, whether detection ran.
    """

    def __init__(
        self, spans: Sequence[Sequence[HistorySpan[WindowQuality]]], first: int, undetected: NDArray[np.bool_]
    ) -> None:
        self._spans = list(chain.from_iterable(spans))
        self._first = first
        camera = np.repeat(np.arange(len(spans)), [len(camera_spans) for camera_spans in spans])
        lengths = np.array([span.last - span.first + 1 for span in self._spans], dtype=np.int64)
        self._tracks = np.array([len(span.window.window.keys) for span in self._spans], dtype=np.int64)
        self._camera = camera
        self.camera: Ints = np.repeat(camera, lengths)
        self.frame = _joined([np.arange(span.first - first, span.last - first + 1) for span in self._spans])
        self.has_detection = ~undetected[self.camera, self.frame]
        self.row: Ints = np.repeat(np.arange(len(self.frame)), np.repeat(self._tracks, lengths))
        self.quality: Floats = np.concatenate([np.zeros(0), *(_quality(span) for span in self._spans)])
        self._begins = np.cumsum(np.concatenate([[0], lengths * self._tracks]))

    def persons(self, people: PersonTracker, numbers: Ints, frames: int) -> Ints:
        """Return the person of each track and frame, (L,): indices into the sorted numbers (K,); -1: none.

        A track may be in several windows; its numbers are looked up once.
        """
        if not len(self.quality) or not len(numbers):
            return np.full(len(self.quality), -1)
        windows = [span.window.window for span in self._spans]
        local_ids = np.concatenate([window.local_ids for window in windows])
        tracks = np.repeat(self._camera, self._tracks) * (local_ids.max() + 1) + local_ids
        _, once, back = np.unique(tracks, return_index=True, return_inverse=True)
        keys = list(chain.from_iterable(window.keys for window in windows))
        track_numbers = people.numbers([keys[at] for at in once.tolist()], self._first, frames)
        persons = np.ascontiguousarray(_indices_over_frames(track_numbers, numbers).T)
        each = np.split(back, np.cumsum(self._tracks)[:-1])
        return _joined(
            [
                persons[span.first - self._first : span.last - self._first + 1, columns].reshape(-1)
                for span, columns in zip(self._spans, each, strict=True)
            ]
        )

    def boxes(self, places: Ints) -> Floats:
        """Return the boxes at flat indices (P,), rising: (P, 4) pixels of the site's image."""
        boxes = np.empty((len(places), 4))
        ends = np.searchsorted(places, self._begins)
        for span, begin, start, end in zip(
            self._spans, self._begins.tolist(), ends.tolist(), ends[1:].tolist(), strict=False
        ):
            window = span.window.window
            frame, track = np.divmod(places[start:end] - begin, max(len(window.keys), 1))
            boxes[start:end] = window.boxes[track, frame + span.first - window.first]
        return boxes

    def terms(self, place: int) -> Floats:
        """Return the quality terms at a flat index, (terms,)."""
        number = int(np.searchsorted(self._begins, place, side="right")) - 1
        span = self._spans[number]
        quality = span.window
        frame, track = divmod(place - int(self._begins[number]), quality.quality.shape[1])
        return np.asarray(quality.terms[:, frame + span.first - quality.window.first, track])


def _joined(parts: Sequence[Ints]) -> Ints:
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts])


def _quality(span: HistorySpan[WindowQuality]) -> Floats:
    """Return the quality of a span's tracks, flattened."""
    quality, first = span.window.quality, span.window.window.first
    return quality[span.first - first : span.last - first + 1].reshape(-1)


def find_indices(numbers: Ints, known: Ints) -> Ints:
    """Return the indices of numbers (T,) in the sorted numbers (K,); -1: not among them."""
    if not len(known):
        return np.full(numbers.shape, -1)
    at = np.minimum(np.searchsorted(known, numbers), len(known) - 1)
    return np.where(known[at] == numbers, at, -1)


def _indices_over_frames(numbers: Ints, known: Ints) -> Ints:
    """Return the indices of numbers (T, N) likewise; most tracks keep one number in all frames."""
    changing = (numbers != numbers[:, :1]).any(axis=1)
    indices = np.repeat(find_indices(numbers[:, 0], known)[:, None], numbers.shape[1], axis=1)
    if changing.any():
        indices[changing] = find_indices(numbers[changing], known)
    return indices
