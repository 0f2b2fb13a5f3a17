"""From which frame on a track is whose: the parts of a track, and the numbers that follow for each frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bestview import TrackKey, TrackletKey

NOBODY_YET = -1
"""Stands for a person's number where a track is not confirmed to be anybody."""


class TrackPart(NamedTuple):
    """From which frame on a track is a person's.

    A named tuple, since one is made of every track in every update.
    """

    first: int
    number: int


UNKNOWN = (TrackPart(0, NOBODY_YET),)
"""The parts of a track that nothing was said of."""


def track_parts(numbers: Mapping[TrackletKey, int]) -> dict[TrackKey, list[TrackPart]]:
    """Sort the numbers of episodes by track, the episodes of each in order."""
    parts: dict[TrackKey, list[TrackPart]] = {}
    for key, number in numbers.items():
        parts.setdefault(key.track, []).append(TrackPart(key.first_frame, number or NOBODY_YET))
    return parts


def merge_settled_parts(
    before: Sequence[TrackPart], parts: list[TrackPart], needed_from: int
) -> list[TrackPart]:
    """Put parts that the registry has settled before those that may still change.

    A long look-ahead asks for frames that are older than what the registry still speaks of; ``asked_from`` is
    the first that anybody asks for.
    """
    settled = [part for part in before if part.first < parts[0].first]
    if not settled:
        return parts
    ends = [*(part.first for part in settled[1:]), parts[0].first]
    asked = [part for part, end in zip(settled, ends, strict=True) if end > needed_from]
    return asked + parts


def person_numbers(known: Sequence[Sequence[TrackPart]], first: int, frames: int) -> NDArray[np.int64]:
    """Return the persons' numbers behind T tracks, by their parts, frame by frame: (T, frames)."""
    newest = np.fromiter((parts[-1].number for parts in known), dtype=np.int64, count=len(known))
    since = np.fromiter((parts[-1].first for parts in known), dtype=np.int64, count=len(known))
    if (since <= first).all():
        return np.broadcast_to(newest[:, None], (len(known), frames))
    numbers = np.repeat(newest[:, None], frames, axis=1)
    for row in np.flatnonzero(since > first).tolist():
        numbers[row] = NOBODY_YET
        for part in known[row]:
            numbers[row, max(0, part.first - first) :] = part.number
    return numbers
