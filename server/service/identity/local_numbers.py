"""One number per track and camera, over all runs of the camera's process."""

from __future__ import annotations

import msgspec

from bestview import TrackKey
from server.messaging.messages import CameraTracks


class TrackName(msgspec.Struct, frozen=True, array_like=True):
    """A track by the name that its camera gives it."""

    camera: str
    boot: int
    """Which run of the camera's process."""
    track: int


class LocalNumbers:
    """Numbers each camera's tracks from 1 in the order they are heard of.

    A restarted camera's tracker counts from 1 again: the boot tells its tracks from earlier ones.
    """

    def __init__(self) -> None:
        self._keys: dict[tuple[str, int], dict[int, TrackKey]] = {}
        """Of each run of a camera, by the tracker's numbers."""
        self._origin: dict[TrackKey, tuple[int, int]] = {}
        """The run and the tracker's number."""
        self._counts: dict[str, int] = {}

    def of(self, message: CameraTracks) -> tuple[TrackKey, ...]:
        """Return what the tracks of a message are called here."""
        if not message.tracks:
            return ()
        keys = self._keys.setdefault((message.camera, message.boot), {})
        for track in message.tracks:
            if track.id not in keys:
                keys[track.id] = self._new(message.camera, message.boot, track.id)
        return tuple([keys[track.id] for track in message.tracks])

    def known(self, camera: str, boot: int, track: int) -> TrackKey | None:
        """Return what a track that was in some message is called here."""
        return self._keys.get((camera, boot), {}).get(track)

    def origin(self, key: TrackKey) -> TrackName:
        """Return what the camera calls a track that is not forgotten."""
        return TrackName(key.camera, *self._origin[key])

    def exchange(self, one: TrackKey, two: TrackKey) -> None:
        """Let two tracks of one run of a camera take each other's name here from now on."""
        (boot, first), (_, second) = self._origin[one], self._origin[two]
        self._origin[one], self._origin[two] = (boot, second), (boot, first)
        self._keys[one.camera, boot] |= {first: two, second: one}

    def forget(self, key: TrackKey) -> None:
        """Let go of a track; should it come back it has a new number."""
        origin = self._origin.pop(key, None)
        if origin is None:
            return
        boot, track = origin
        keys = self._keys[key.camera, boot]
        del keys[track]
        if not keys:
            del self._keys[key.camera, boot]

    def _new(self, camera: str, boot: int, track: int) -> TrackKey:
        self._counts[camera] = self._counts.get(camera, 0) + 1
        key = TrackKey(camera, self._counts[camera])
        self._origin[key] = boot, track
        return key
