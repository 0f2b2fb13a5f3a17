"""The frames in which a camera ran no detection, so that absence of a box proves nothing."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from server.messaging.messages import CameraTracks


class UndetectedFrames:
    """Keeps the frames without detection, by camera: a person may be there all the same."""

    def __init__(self) -> None:
        self._frames: dict[str, set[int]] = defaultdict(set)

    def note(self, message: CameraTracks) -> None:
        """Add the frames that a camera's message reports."""
        self._frames[message.camera].update(message.without_detection)

    def over(self, camera: str, first: int, frames: int) -> NDArray[np.bool_]:
        """Return for each of a camera's frames from `first` on whether it could not detect, (frames,)."""
        known = self._frames.get(camera, set())
        return np.array([it in known for it in range(first, first + frames)], dtype=np.bool_)

    def forget_before(self, pulse: int) -> None:
        """Forget the frames before a pulse."""
        for camera, frames in self._frames.items():
            self._frames[camera] = {it for it in frames if it >= pulse}
