"""The frames in which a camera ran no detection: a missing box does not mean that nobody was there."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from server.messaging.messages import CameraTracks
from server.messaging.packed_arrays import unpack_boxes
from server.messaging.picture_motion import is_turned
from server.service.identity.camera_window import CameraWindow
from tracking.boxes import areas

_MUCH_HIDDEN = 0.25
"""Share of a camera's picture."""


class UndetectedFrames:
    """Keeps the frames without detection, by camera."""

    def __init__(self) -> None:
        self._frames: dict[str, set[int]] = defaultdict(set)

    def add(self, message: CameraTracks) -> None:
        """Add the frames that a camera's message reports."""
        self._frames[message.camera].update(message.without_detection)

    def over(self, camera: str, first: int, frames: int) -> NDArray[np.bool_]:
        """Return for each of a camera's frames from `first` on whether it could not detect, (frames,)."""
        known = self._frames.get(camera, set())
        return np.array([pulse in known for pulse in range(first, first + frames)], dtype=np.bool_)

    def detecting_cameras(
        self, windows: Iterable[CameraWindow], first: int, last: int
    ) -> dict[str, tuple[int, int]]:
        """Return the image sizes of the cameras that ran detection in any of these frames.

        Cameras that were turned away, or in which much is hidden, are left out: their homographies do not say
        whom they should see.
        """
        return {
            window.message.camera: window.message.size
            for window in windows
            if not is_turned(window.message.motion, window.letterbox.site_size)
            and _hidden_share(window) < _MUCH_HIDDEN
            and not self.over(window.message.camera, first, last + 1 - first).all()
        }

    def forget_before(self, pulse: int) -> None:
        """Forget the frames before a pulse."""
        for camera, frames in self._frames.items():
            self._frames[camera] = {frame for frame in frames if frame >= pulse}


def _hidden_share(window: CameraWindow) -> float:
    """Return the share of a camera's own picture, without the site's bars, in which people are hidden."""
    *_, width, height = window.letterbox.content
    return float(areas(unpack_boxes([window.message.covered])).sum()) / (width * height)
