"""What cameras' tracks, and the parts of tracks that are surely one person, are called."""

from __future__ import annotations

from typing import NamedTuple


class TrackKey(NamedTuple):
    """A camera's own track.

    A named tuple, since thousands are hashed and compared in every update.
    """

    camera: str
    local: int


class EpisodeKey(NamedTuple):
    """The part of a camera's track that begins with the frame `first`."""

    camera: str
    local: int
    first: int

    @property
    def track(self) -> TrackKey:
        """The whole track."""
        return TrackKey(self.camera, self.local)
