"""Keys of tracks and tracklets."""

from __future__ import annotations

from typing import NamedTuple


class TrackKey(NamedTuple):
    """A track of one camera.

    A named tuple, since thousands are hashed and compared in every update.
    """

    camera: str
    local_id: int


class TrackletKey(NamedTuple):
    """The tracklet of a camera's track that starts with `first_frame`."""

    camera: str
    local_id: int
    first_frame: int

    @property
    def track(self) -> TrackKey:
        """The key of the whole track."""
        return TrackKey(self.camera, self.local_id)
