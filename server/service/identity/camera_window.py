"""A camera's track message of one epoch, decoded: track keys, and boxes as arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestview import AppearanceHistogram, TrackKey, TrackUpdate
from server.media.letterbox import Letterbox
from server.messaging import messages
from server.messaging.messages import CameraTracks
from server.messaging.packed_arrays import unpack_boxes, unpack_histograms
from server.messaging.picture_motion import calibrated_boxes
from server.service.identity.local_numbers import GROUND, LocalNumbers
from server.service.ingest.epoch_aligner import Epoch, JointEpoch

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class CameraWindow:
    """One camera's T tracks over a window of F frames.

    Attributes:
        message: the message itself.
        keys: the site-wide keys of the tracks; T of them.
        local_ids: (T,) the keys' local ids.
        letterbox: the letterbox from the camera's image to the site's.
        boxes: (T, F, 4) pixels of the site's image, NaN where hidden.
        fresh: the first frame that was not final before; later than `first` for a revision of the past.
    """

    message: CameraTracks
    keys: tuple[TrackKey, ...]
    local_ids: NDArray[np.int64]
    letterbox: Letterbox
    boxes: Floats
    fresh: int

    @property
    def first(self) -> int:
        """The pulse of the first frame."""
        return self.message.first

    def fresh_tracks(self) -> list[TrackUpdate]:
        """Return the newly final, visible parts of the tracks, boxes in the camera's own pixels.

        If the camera has been knocked, they are where its homography holds.
        """
        _, height = self.message.size
        final = slice(self.fresh - self.first, max(0, self.message.final_to - self.first + 1))
        hidden = np.isnan(self.boxes[:, final, 0])
        boxes = calibrated_boxes(self.boxes[:, final], self.message.motion)
        camera_boxes = self.letterbox.boxes_site_to_camera(boxes)
        return [
            TrackUpdate(
                camera=key.camera,
                local_id=key.local_id,
                first_frame=self.fresh,
                boxes=boxes,
                appearance=_appearance_histograms(track.appearance, self.fresh),
                picture_height=float(height),
            )
            for key, track, boxes, is_hidden in zip(
                self.keys, self.message.tracks, camera_boxes, hidden, strict=True
            )
            if not is_hidden.all()
        ]

    def visible_spans(self) -> list[tuple[int, int]]:
        """Return each track's first and last frame with a box; without any, the last is before the first."""
        visible = ~np.isnan(self.boxes[:, :, 0])
        if not visible.size:
            return [(self.first, self.first - 1)] * len(self.keys)
        begins = self.first + visible.argmax(axis=1)
        ends = self.first + visible.shape[1] - 1 - visible[:, ::-1].argmax(axis=1)
        ends[~visible.any(axis=1)] = self.first - 1
        return list(zip(begins.tolist(), ends.tolist(), strict=True))


def _appearance_histograms(
    histograms: Sequence[messages.AppearanceHistogram], first: int
) -> tuple[AppearanceHistogram, ...]:
    """Return the histograms in the frames from `first` on."""
    return tuple(
        AppearanceHistogram(
            max(message.first, first), message.last, unpack_histograms(message.histogram, 1)[0]
        )
        for message in histograms
        if message.last >= first
    )


class WindowReader:
    """Decodes epochs into camera windows; keeps the track keys and each camera's letterbox."""

    def __init__(self, site_size: tuple[int, int]) -> None:
        self._site_size = site_size
        self.local_numbers = LocalNumbers()
        self.letterboxes: dict[str, Letterbox] = {}
        """By camera, from its first message on; replaced when its image size changes."""
        self._final: dict[str, int] = {}
        """By camera, the last frame that was final."""

    def read(self, epoch: Epoch) -> Sequence[CameraWindow]:
        """Decode the messages of all cameras, in the order of the epoch."""
        windows = [self._window(message, epoch.joint) for message in epoch.tracks.values()]
        self._final |= {window.message.camera: window.message.final_to for window in windows}
        return windows

    def final_to(self, camera: str) -> int:
        """Return the last frame that the camera's windows have made final; -1: none."""
        return self._final.get(camera, -1)

    def read_late(self, epoch: Epoch) -> Iterator[CameraWindow]:
        """Yield the revisions of the past that arrived too late for their epoch.

        Decoded lazily: the repair of one may exchange the keys that the next is decoded with.
        """
        for message in epoch.late_revisions:
            yield self._window(message)

    def _window(self, message: CameraTracks, joint: JointEpoch | None = None) -> CameraWindow:
        letterbox = self.letterboxes.get(message.camera)
        if letterbox is None or letterbox.camera_size != message.size:
            letterbox = self.letterboxes[message.camera] = Letterbox(message.size, self._site_size)
        if joint is not None and message.camera in joint.own:
            ids = [track.id for track in message.tracks]
            keys = self.local_numbers.keys(GROUND, joint.tracks.run, ids)
        else:
            keys = self.local_numbers.of(message)
        frames = max(0, message.last - message.first + 1)
        boxes = unpack_boxes(track.boxes for track in message.tracks)
        local_ids = np.array([key.local_id for key in keys], dtype=np.int64)
        fresh = message.first
        if message.revised_from is not None:
            fresh = max(fresh, min(self.final_to(message.camera), message.final_to) + 1)
        return CameraWindow(message, keys, local_ids, letterbox, boxes.reshape(len(keys), frames, 4), fresh)

    def with_current_keys(self, window: CameraWindow) -> CameraWindow:
        """Return a window with its tracks' current keys."""
        keys = self.local_numbers.of(window.message)
        return replace(window, keys=keys, local_ids=np.array([key.local_id for key in keys], dtype=np.int64))
