"""Boxes of a message as an array, fast: they are most of what the best-view service reads."""

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
"""A box in MessagePack: a byte says that four values follow, and one before each that it is a float."""


def boxes_array(tracks: Iterable[list[Box | None]]) -> NDArray[np.float64]:
    """Return the boxes of all tracks one after the other, (B, 4), NaN where hidden.

    NumPy reads numbers out of tuples one at a time. MessagePack writes all of them into one stretch of bytes,
    which is an array already: three times as fast.
    """
    told = list(chain.from_iterable(it if all(it) else [box or _HIDDEN for box in it] for it in tracks))
    packed = msgspec.msgpack.encode(told)
    head = len(packed) - len(told) * _PACKED.itemsize
    if head in (1, 3, 5):  # how long the array is comes first
        sides = np.frombuffer(packed, _PACKED, offset=head)["sides"]
        if (sides["type"] == _FLOAT64).all():
            return sides["value"].astype(np.float64)
    # Somebody wrote whole numbers.
    return np.array(told, dtype=np.float64).reshape(-1, 4)
