"""Keeps which track was behind a person's published box, so that corrections reach the right track."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from server.service.identity.camera_window import CameraWindow
from server.service.identity.local_numbers import TrackName
from server.service.ingest.window_history import HistorySpan


class PublishedTracks:
    """Keeps the tracks behind published person numbers for at least ``frames`` frames; 0: none."""

    def __init__(self) -> None:
        self.frames = 0
        self._published: deque[tuple[int, int, Mapping[tuple[str, int], TrackName]]] = deque()
        self._oldest: int | None = None

    def record(self, span: HistorySpan[CameraWindow], numbers: NDArray[np.int64]) -> None:
        """Record the person numbers (T,) of a window's tracks; those below 0 are unconfirmed.

        Spans must come in frame order across all cameras.
        """
        if self._oldest is None:
            self._oldest = span.first
        message = span.window.message
        tracks = {
            (message.camera, number): TrackName(message.camera, message.boot, track.id)
            for track, number in zip(message.tracks, numbers.tolist(), strict=True)
            if number >= 0
        }
        self._published.append((span.first, span.last, tracks))
        while self._published[0][1] < span.last - self.frames:
            self._oldest = self._published.popleft()[1] + 1

    def forget(self, numbers: Collection[int]) -> None:
        """Forget the tracks behind these people's boxes."""
        self._published = deque(
            (first, last, {key: track for key, track in tracks.items() if key[1] not in numbers})
            for first, last, tracks in self._published
        )

    def covers(self, pulse: int) -> bool:
        """Return whether a frame is still covered."""
        return self._oldest is not None and self._oldest <= pulse

    def latest_track(self, camera: str, numbers: Collection[int], pulse: int) -> TrackName | None:
        """Return the track that showed a person in a frame, or else last before it; None: none did.

        ``numbers`` are all numbers of the person, former ones included.
        """
        for first, _, tracks in reversed(self._published):
            if first <= pulse:
                candidates = [tracks[camera, number] for number in numbers if (camera, number) in tracks]
                if candidates:
                    return candidates[0]
        return None
