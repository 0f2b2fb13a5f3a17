"""What a camera has captured for a pulse."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from server.camera.sources.base import Image
from server.camera.substream.picture_buffer import PictureRequest


@dataclass(frozen=True, slots=True, eq=False)
class CapturedFrame:
    """A frame of a camera's video.

    Attributes:
        pulse: its pulse.
        image: at the site's size; None: it is passed through without being decoded.
        request: for the substream's picture of the same moment; None: there is none to look for.
        taken: when it was taken from the source, by the steady clock.
    """

    pulse: int
    image: Image | None
    request: PictureRequest | None = None
    taken: float = field(default_factory=time.monotonic)
