"""Links each camera's own tracks to the people who are tracked jointly on the ground.

Cameras track by themselves, too: their tracks outlive this service, and thumbnails name them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import scipy

from bestview import TrackKey
from server.messaging.messages import CameraTracks
from server.messaging.packed_arrays import unpack_boxes
from server.service.identity.camera_window import CameraWindow
from server.service.identity.local_numbers import TrackName
from tracking.boxes import Floats, iou

_SAME_IOU = 0.5
"""Overlap from which two boxes are of one person."""


class OwnTracks:
    """Links the tracks of cameras to tracks on the ground, by their newest boxes."""

    def __init__(self) -> None:
        self._links: dict[TrackName, TrackKey] = {}

    def update(
        self, own: Mapping[str, CameraTracks], windows: Iterable[CameraWindow]
    ) -> dict[TrackName, TrackKey]:
        """Link the tracks of an epoch; return the links that are new.

        `own` are the cameras' messages as they came, `windows` those with the tracks on the ground.
        """
        found: dict[TrackName, TrackKey] = {}
        for window in windows:
            message = own.get(window.message.camera)
            if message is not None:
                found |= _matches(message, window)
        new = {name: key for name, key in found.items() if self._links.get(name) != key}
        self._links |= found
        return new

    def key(self, name: TrackName) -> TrackKey | None:
        """Return the track on the ground that a camera's own track shows; None: unknown."""
        return self._links.get(name)

    def names(self, key: TrackKey) -> list[TrackName]:
        """Return the cameras' own tracks that show a track on the ground, in order of appearance."""
        return [name for name, linked in self._links.items() if linked == key]

    def keep_only(self, keys: Iterable[TrackKey]) -> None:
        """Forget the links to all other tracks on the ground."""
        kept = set(keys)
        self._links = {name: key for name, key in self._links.items() if key in kept}


def _matches(message: CameraTracks, window: CameraWindow) -> dict[TrackName, TrackKey]:
    """Match the own tracks with those on the ground in the newest frame that both have."""
    frame = min(message.last, window.message.last)
    first = message.first
    if not message.tracks or not window.keys or not max(first, window.first) <= frame:
        return {}
    frames = message.last - first + 1
    boxes = unpack_boxes(track.boxes for track in message.tracks).reshape(len(message.tracks), frames, 4)
    overlaps = _overlaps(boxes[:, frame - first], window.boxes[:, frame - window.first])
    rows, columns = scipy.optimize.linear_sum_assignment(overlaps, maximize=True)
    return {
        TrackName(message.camera, message.boot, message.tracks[row].id): window.keys[column]
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
        if overlaps[row, column] >= _SAME_IOU
    }


def _overlaps(own: Floats, joint: Floats) -> Floats:
    return np.asarray(np.nan_to_num(iou(own[:, None], joint[None])))
