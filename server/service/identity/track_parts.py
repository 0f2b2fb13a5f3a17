"""The parts of a track by person number, and the numbers of each frame that follow from them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bestview import TrackKey, TrackletKey

UNCONFIRMED = -1
"""The person number of a track that is not confirmed yet."""


class TrackPart(NamedTuple):
    """The part of a track that belongs to one person, from a frame on.

    A named tuple, since one is made of every track in every update.
    """

    first: int
    number: int


UNKNOWN = (TrackPart(0, UNCONFIRMED),)
"""The parts of an unknown track."""


Parts = dict[TrackKey, Sequence[TrackPart]]
"""The parts of each track, in frame order."""


def update_parts(parts: Parts, numbers: Mapping[TrackletKey, int], needed_from: int) -> None:
    """Update, in place, the parts of tracks whose tracklets have these numbers."""
    for key, new in track_parts(numbers).items():
        parts[key] = merge_settled_parts(parts.get(key, ()), new, needed_from)


def replace_numbers(parts: Parts, numbers: Mapping[int, int]) -> None:
    """Replace people's numbers, in place."""
    for key, known in parts.items():
        parts[key] = [TrackPart(part.first, numbers.get(part.number, part.number)) for part in known]


def unconfirm(parts: Parts, numbers: Collection[int]) -> list[TrackKey]:
    """Take these people's numbers from their tracks, in place; return the tracks."""
    shown = [key for key, known in parts.items() if any(part.number in numbers for part in known)]
    replace_numbers(parts, dict.fromkeys(numbers, UNCONFIRMED))
    return shown


def track_parts(numbers: Mapping[TrackletKey, int]) -> dict[TrackKey, list[TrackPart]]:
    """Group the numbers of tracklets by track, in frame order."""
    parts: dict[TrackKey, list[TrackPart]] = {}
    for key, number in numbers.items():
        parts.setdefault(key.track, []).append(TrackPart(key.first_frame, number or UNCONFIRMED))
    return parts


def merge_settled_parts(
    before: Sequence[TrackPart], parts: list[TrackPart], needed_from: int
) -> list[TrackPart]:
    """Prepend the settled parts of a track to those that may still change.

    A long look-ahead needs frames older than those the registry still reports; ``needed_from`` is the first.
    """
    settled = [part for part in before if part.first < parts[0].first]
    if not settled:
        return parts
    ends = [*(part.first for part in settled[1:]), parts[0].first]
    needed = [part for part, end in zip(settled, ends, strict=True) if end > needed_from]
    return needed + parts


def person_numbers(known: Sequence[Sequence[TrackPart]], first: int, frames: int) -> NDArray[np.int64]:
    """Return the persons' numbers behind T tracks, by their parts, frame by frame: (T, frames)."""
    newest = np.fromiter((parts[-1].number for parts in known), dtype=np.int64, count=len(known))
    since = np.fromiter((parts[-1].first for parts in known), dtype=np.int64, count=len(known))
    if (since <= first).all():
        return np.broadcast_to(newest[:, None], (len(known), frames))
    numbers = np.repeat(newest[:, None], frames, axis=1)
    for row in np.flatnonzero(since > first).tolist():
        numbers[row] = UNCONFIRMED
        for part in known[row]:
            numbers[row, max(0, part.first - first) :] = part.number
    return numbers
