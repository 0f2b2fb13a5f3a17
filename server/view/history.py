"""Who was where: one camera's boxes by pulse, the newest word on each frame."""

from __future__ import annotations

from bestview import TrackKey
from server.view.reading import CameraWindow
from server.wire.messages import Box


class BoxHistory:
    """Keeps for every frame of one camera the window that spoke of it last.

    Boxes are looked up when they are asked for: most windows are replaced before anybody does.
    """

    def __init__(self) -> None:
        self._windows: dict[int, CameraWindow] = {}

    def put(self, window: CameraWindow) -> None:
        """Take over a window."""
        self._windows.update(dict.fromkeys(range(window.first, window.message.last + 1), window))

    def at(self, pulse: int) -> dict[TrackKey, Box]:
        """Give the boxes of a frame by track."""
        window = self._windows.get(pulse)
        if window is None:
            return {}
        place = pulse - window.first
        return {
            key: box
            for key, track in zip(window.keys, window.message.tracks, strict=True)
            if (box := track.boxes[place]) is not None
        }

    def forget_before(self, pulse: int) -> None:
        """Let go of the frames before a pulse."""
        for old in [known for known in self._windows if known < pulse]:
            del self._windows[old]
