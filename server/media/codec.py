"""The stream format of a site, by its codec."""

from __future__ import annotations

from typing import Literal

from server.media.stream_format import Agreement, OwnParameters
from server.media.vp8.stream_format import Vp8Agreement

Codec = Literal["h264", "vp8"]


def agreement_for(codec: Codec, size: tuple[int, int], *, own_parameters: bool = False) -> Agreement:
    """Return what all streams of a site are made of, before any picture has come.

    ``size``: width and height of its pictures. ``own_parameters``: each camera may have H.264 parameter sets
    of its own.
    """
    if codec == "vp8":
        return Vp8Agreement(*size)
    return OwnParameters() if own_parameters else Agreement()
