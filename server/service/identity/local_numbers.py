"""Numbers tracks per camera across restarts of the camera's process."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from bestview import TrackKey
from server.messaging.messages import CameraTracks

GROUND = "(ground)"
"""Stands for all cameras that are tracked jointly; no camera can have this id."""


class TrackName(msgspec.Struct, frozen=True, array_like=True):
    """A track as its camera identifies it."""

    camera: str
    boot: int
    """The run of the camera's process."""
    track: int


class LocalNumbers:
    """Maps each camera's tracks to numbers from 1, in order of appearance.

    A restarted camera's tracker counts from 1 again; the boot distinguishes its tracks from earlier ones.
    """

    def __init__(self) -> None:
        self._keys: dict[tuple[str, int], dict[int, TrackKey]] = {}
        """By run of a camera, then by the tracker's number."""
        self._origin: dict[TrackKey, tuple[int, int]] = {}
        """The run and the tracker's number."""
        self._counts: dict[str, int] = {}

    def of(self, message: CameraTracks) -> tuple[TrackKey, ...]:
        """Return the keys of a message's tracks, new ones for new tracks."""
        return self.keys(message.camera, message.boot, [track.id for track in message.tracks])

    def keys(self, camera: str, boot: int, tracks: Sequence[int]) -> tuple[TrackKey, ...]:
        """Return the keys of tracks, new ones for new tracks."""
        if not tracks:
            return ()
        keys = self._keys.setdefault((camera, boot), {})
        for track in tracks:
            if track not in keys:
                keys[track] = self._new(camera, boot, track)
        return tuple([keys[track] for track in tracks])

    def known(self, camera: str, boot: int, track: int) -> TrackKey | None:
        """Return the key of a track; None: it is unknown or forgotten."""
        return self._keys.get((camera, boot), {}).get(track)

    def origin(self, key: TrackKey) -> TrackName:
        """Return the camera's own name of a known track."""
        return TrackName(key.camera, *self._origin[key])

    def exchange(self, one: TrackKey, two: TrackKey) -> None:
        """Exchange the keys of two tracks of one run of a camera from now on."""
        (boot, first), (_, second) = self._origin[one], self._origin[two]
        self._origin[one], self._origin[two] = (boot, second), (boot, first)
        self._keys[one.camera, boot] |= {first: two, second: one}

    def forget(self, key: TrackKey) -> None:
        """Forget a track; if it reappears it gets a new number."""
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
