"""What a camera said of an epoch, read once: its tracks' names, and their boxes as arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestview import AppearanceSample, TrackKey, TrackUpdate
from server.media.letterbox import Letterbox
from server.messaging import messages
from server.messaging.messages import CameraTracks
from server.service.identity.local_numbers import LocalNumbers
from server.service.ingest.box_arrays import boxes_array
from server.service.ingest.epoch_aligner import Epoch

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class CameraWindow:
    """One camera's T tracks over a window of F frames.

    Attributes:
        message: as it came.
        keys: what the tracks are called here; T of them.
        locals: (T,) their numbers.
        fit: how the camera's own picture lies in the site's.
        boxes: (T, F, 4) pixels of the site's picture, NaN where hidden.
        fresh: the first frame that was not final before: the first of all, unless the past was mended.
    """

    message: CameraTracks
    keys: tuple[TrackKey, ...]
    locals: NDArray[np.int64]
    fit: Letterbox
    boxes: Floats
    fresh: int

    @property
    def first(self) -> int:
        """The pulse of the first frame."""
        return self.message.first

    def local_tracks(self) -> list[TrackUpdate]:
        """Return what is final of the tracks, where it is anything, boxes in the camera's own picture."""
        _, height = self.message.size
        known = slice(self.fresh - self.first, max(0, self.message.final_to - self.first + 1))
        hidden = np.isnan(self.boxes[:, known, 0])
        own = self.fit.boxes_to_own(self.boxes[:, known])
        return [
            TrackUpdate(
                camera=key.camera,
                local_id=key.local_id,
                first_frame=self.fresh,
                boxes=boxes,
                appearance=_appearance_samples(track.appearance, self.fresh),
                picture_height=float(height),
            )
            for key, track, boxes, gone in zip(self.keys, self.message.tracks, own, hidden, strict=True)
            if not gone.all()
        ]

    def seen_spans(self) -> list[tuple[int, int]]:
        """Return each track's first and last frame with a box; the last is lower: none."""
        there = ~np.isnan(self.boxes[:, :, 0])
        if not there.size:
            return [(self.first, self.first - 1)] * len(self.keys)
        begins = self.first + there.argmax(axis=1)
        ends = self.first + there.shape[1] - 1 - there[:, ::-1].argmax(axis=1)
        ends[~there.any(axis=1)] = self.first - 1
        return list(zip(begins.tolist(), ends.tolist(), strict=True))


def _appearance_samples(
    looks: Sequence[messages.AppearanceHistogram], first: int
) -> tuple[AppearanceSample, ...]:
    """Return the looks in the frames from `first` on."""
    return tuple(
        AppearanceSample(max(it.first, first), it.last, np.array(it.histogram, dtype=np.float64))
        for it in looks
        if it.last >= first
    )


class WindowReader:
    """Parses epochs into camera windows, and keeps the tracks' names and each camera's letterbox."""

    def __init__(self, site_size: tuple[int, int]) -> None:
        self._site_size = site_size
        self.locals = LocalNumbers()
        self.fits: dict[str, Letterbox] = {}
        """Of each camera, known from its first word on; its picture has another size after another source."""
        self._final: dict[str, int] = {}
        """By camera, the last frame that was final."""

    def read(self, epoch: Epoch) -> Sequence[CameraWindow]:
        """Return what all cameras said, in the order of the epoch."""
        windows = [self._window(message) for message in epoch.tracks.values()]
        self._final |= {it.message.camera: it.message.final_to for it in windows}
        return windows

    def read_late(self, epoch: Epoch) -> Iterator[CameraWindow]:
        """Yield what has mended the past, and came too late for its own epoch, one word after the other.

        Each is read when it is asked for: the one before may have changed what tracks are called.
        """
        for message in epoch.mended:
            yield self._window(message)

    def _window(self, message: CameraTracks) -> CameraWindow:
        fit = self.fits.get(message.camera)
        if fit is None or fit.own != message.size:
            fit = self.fits[message.camera] = Letterbox(message.size, self._site_size)
        keys = self.locals.of(message)
        frames = max(0, message.last - message.first + 1)
        boxes = boxes_array(track.boxes for track in message.tracks)
        locals_ = np.array([key.local_id for key in keys], dtype=np.int64)
        fresh = message.first
        if message.revised_from is not None:
            fresh = max(fresh, min(self._final.get(message.camera, -1), message.final_to) + 1)
        return CameraWindow(message, keys, locals_, fit, boxes.reshape(len(keys), frames, 4), fresh)

    def with_current_keys(self, window: CameraWindow) -> CameraWindow:
        """Return a window by what its tracks are called now."""
        keys = self.locals.of(window.message)
        return replace(window, keys=keys, locals=np.array([key.local_id for key in keys], dtype=np.int64))
