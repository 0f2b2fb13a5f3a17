"""Fast conversion of a message's boxes to an array: boxes are most of the data that the service receives."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain

import msgspec
import numpy as np
from numpy.typing import NDArray

from server.messaging.messages import Box

_HIDDEN: Box = (np.nan,) * 4
_FLOAT64 = 0xCB
_PACKED = np.dtype([("array", "u1"), ("sides", [("type", "u1"), ("value", ">f8")], (4,))])
"""A box in MessagePack: a byte for an array of four, then four times a type byte and a float64."""


def boxes_array(tracks: Iterable[list[Box | None]]) -> NDArray[np.float64]:
    """Return the boxes of all tracks one after the other, (B, 4), NaN where hidden.

    The boxes are encoded as MessagePack, whose bytes NumPy reads as an array: three times as fast as
    converting tuples.
    """
    boxes = list(
        chain.from_iterable(track if all(track) else [box or _HIDDEN for box in track] for track in tracks)
    )
    packed = msgspec.msgpack.encode(boxes)
    head = len(packed) - len(boxes) * _PACKED.itemsize
    if head in (1, 3, 5):  # bytes of the outer array's length
        sides = np.frombuffer(packed, _PACKED, offset=head)["sides"]
        if (sides["type"] == _FLOAT64).all():
            return sides["value"].astype(np.float64)
    # A sender wrote integers.
    return np.array(boxes, dtype=np.float64).reshape(-1, 4)
