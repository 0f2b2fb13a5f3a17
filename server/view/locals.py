"""One number per track and camera, over all runs of the camera's process."""

from __future__ import annotations

from bestview import TrackKey
from server.wire.messages import CameraTracks


class LocalNumbers:
    """Numbers each camera's tracks from 1 in the order they are heard of.

    A restarted camera's tracker counts from 1 again: the boot tells its tracks from earlier ones.
    """

    def __init__(self) -> None:
        self._local: dict[tuple[str, int, int], int] = {}
        self._origin: dict[TrackKey, tuple[str, int, int]] = {}
        self._counts: dict[str, int] = {}

    def of(self, message: CameraTracks) -> dict[int, int]:
        """Give the local number of every track in a message."""
        return {track.id: self._number(message.camera, message.boot, track.id) for track in message.tracks}

    def known(self, camera: str, boot: int, track: int) -> int | None:
        """Give the local number of a track that was in some message."""
        return self._local.get((camera, boot, track))

    def forget(self, key: TrackKey) -> None:
        """Let go of a track; should it come back it has a new number."""
        origin = self._origin.pop(key, None)
        if origin is not None:
            del self._local[origin]

    def _number(self, camera: str, boot: int, track: int) -> int:
        origin = (camera, boot, track)
        if origin not in self._local:
            self._counts[camera] = self._counts.get(camera, 0) + 1
            self._local[origin] = self._counts[camera]
            self._origin[TrackKey(camera, self._counts[camera])] = origin
        return self._local[origin]
