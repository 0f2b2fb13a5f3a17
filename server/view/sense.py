"""Whether a camera's message, well formed as it is, can be true: what follows relies on it."""

from __future__ import annotations

from server.wire.epochs import end_of_epoch
from server.wire.messages import CameraTracks

_WINDOW_MAX = 100_000
"""Frames of one message; far more than any window and any gap that a tracker joins."""


def makes_sense(message: CameraTracks, stride: int) -> bool:
    """Tell whether the frames, the tracks and the sizes in a message fit together."""
    frames = message.last - message.first + 1
    ids = [track.id for track in message.tracks]
    looks = [look for track in message.tracks for look in track.looks]
    bins = [len(look.histogram) for look in looks]
    return (
        0 <= frames <= _WINDOW_MAX
        and message.last <= end_of_epoch(message.epoch, stride)
        and len(message.shed) <= _WINDOW_MAX
        and len(message.unsearched) <= _WINDOW_MAX
        and len(message.alone) <= _WINDOW_MAX
        and len(ids) == len(dict.fromkeys(ids))
        and all(count == bins[0] > 0 for count in bins)
        and all(len(track.boxes) == frames for track in message.tracks)
        and (message.mended_from is None or message.first <= message.mended_from <= message.final_to)
        and all(message.first <= look.first <= look.last <= message.final_to for look in looks)
    )
