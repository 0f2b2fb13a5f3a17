"""The frames in which a camera ran no detection: a missing box does not mean that nobody was there."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from server.messaging.messages import CameraTracks


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

    def forget_before(self, pulse: int) -> None:
        """Forget the frames before a pulse."""
        for camera, frames in self._frames.items():
            self._frames[camera] = {frame for frame in frames if frame >= pulse}
