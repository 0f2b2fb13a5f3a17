"""Who is who after a meeting: paths keep to nobody's colours, so they are told apart by these afterwards.

The map says that somebody is there, not who. Where paths meet, the shortest ones go straight on or swap by
chance. As in Fleuret et al. (section 4) everybody has colours in each camera, learned where they stand apart;
after a meeting the numbers go to the paths that look most like them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from tracking.boxes import Floats

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class MeetingSettings:
    """When people meet, and what it takes to say that paths swapped them.

    Attributes:
        near: how close, in person heights, is a meeting.
        margin: by how much less alike the paths' own ends have to look, in Bhattacharyya distances.
        least_pixels: foreground that nobody else covers, in one camera, before a look counts.
        most_frames: of how many frames after a meeting looks are taken.
    """

    near: float = 0.4
    margin: float = 0.02
    least_pixels: float = 500.0
    most_frames: int = 250


@dataclass(frozen=True, slots=True, eq=False)
class PathAppearance:
    """One path and what it looks like.

    Attributes:
        first: its first frame.
        places: (F, 2) on the ground.
        looks: (F, C, B) the histograms in each camera, rows summing to 1.
        pixels: (F, C) how many pixels they are of; 0: nothing is known.
    """

    first: int
    places: Floats
    looks: NDArray[np.float32]
    pixels: NDArray[np.float32]

    @property
    def end(self) -> int:
        """The frame after its last."""
        return self.first + len(self.places)

    def look(self, begin: int, end: int) -> _AppearanceSums:
        """Return what it looks like over some frames."""
        span = slice(max(begin - self.first, 0), max(end - self.first, 0))
        pixels = self.pixels[span].astype(np.float64)
        return _AppearanceSums((self.looks[span] * pixels[..., None]).sum(axis=0), pixels.sum(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class _AppearanceSums:
    """Sums over frames: (C, B) histograms by pixels, (C,) pixels."""

    rows: Floats
    pixels: Floats

    def and_also(self, other: _AppearanceSums) -> _AppearanceSums:
        return _AppearanceSums(self.rows + other.rows, self.pixels + other.pixels)

    def apart(self, other: _AppearanceSums, least: float) -> float:
        """Return the mean Bhattacharyya distance over the cameras that know both; NaN: none does."""
        known = (self.pixels >= least) & (other.pixels >= least)
        if not known.any():
            return float("nan")
        one = self.rows[known] / self.pixels[known][:, None]
        two = other.rows[known] / other.pixels[known][:, None]
        alike = np.sqrt(one * two).sum(axis=1)
        return float(np.sqrt(np.maximum(1.0 - alike, 0.0)).mean())


@dataclass(frozen=True, slots=True)
class _Meeting:
    """Frames `begin` to `end`, the latter not in it, and who met."""

    begin: int
    end: int
    members: frozenset[int]


def numbers_of(walkers: Sequence[PathAppearance], person: float, settings: MeetingSettings) -> list[Ints]:
    """Return every path's number (F,) in each of its frames.

    Args:
        walkers: the paths.
        person: how long a person's height is in units of the ground.
        settings: what tells people apart.
    """
    numbers = [np.full(len(it.places), place + 1, dtype=np.int64) for place, it in enumerate(walkers)]
    known = [_AppearanceSums(np.zeros(it.looks.shape[1:]), np.zeros(it.pixels.shape[1:])) for it in walkers]
    since = [it.first for it in walkers]
    meetings = _meetings(walkers, settings.near * person)
    for place, meeting in enumerate(meetings):
        through = sorted(
            it
            for it in meeting.members
            if walkers[it].first < meeting.begin and walkers[it].end > meeting.end
        )
        who = [int(numbers[it][meeting.begin - 1 - walkers[it].first]) - 1 for it in through]
        for path, number in zip(through, who, strict=True):
            known[number] = known[number].and_also(walkers[path].look(since[path], meeting.begin))
        apart = np.full((len(through), len(through)), np.nan)
        for path in meeting.members:
            since[path] = meeting.end
        for column, path in enumerate(through):
            later = (it.begin for it in meetings[place + 1 :] if path in it.members)
            end = min(next(later, walkers[path].end), meeting.end + settings.most_frames)
            after = walkers[path].look(meeting.end, end)
            apart[:, column] = [known[it].apart(after, settings.least_pixels) for it in who]
        if len(through) < 2 or np.isnan(apart).any():
            continue
        goes, to = linear_sum_assignment(apart - settings.margin * np.eye(len(through)))
        for one, other in zip(goes.tolist(), to.tolist(), strict=True):
            walker = walkers[through[other]]
            middle = (meeting.begin + meeting.end) // 2 - walker.first
            numbers[through[other]][middle:] = who[one] + 1
    return numbers


def _meetings(walkers: Sequence[PathAppearance], near: float) -> list[_Meeting]:
    """Return the meetings in order: frames in which paths are near each other, overlapping ones as one."""
    found: list[_Meeting] = []
    for one, first in enumerate(walkers):
        for other, second in enumerate(walkers[:one]):
            begin, end = max(first.first, second.first), min(first.end, second.end)
            if begin >= end:
                continue
            here = first.places[begin - first.first : end - first.first]
            there = second.places[begin - second.first : end - second.first]
            close = np.linalg.norm(here - there, axis=1) < near
            edges = np.flatnonzero(np.diff(np.concatenate([[False], close, [False]]).astype(np.int8)))
            for start, stop in edges.reshape(-1, 2).tolist():
                found.append(_Meeting(begin + start, begin + stop, frozenset((one, other))))
    merged: list[_Meeting] = []
    for meeting in sorted(found, key=lambda it: (it.begin, it.end, sorted(it.members))):
        it = meeting
        for before in list(merged):
            if before.members & it.members and before.end >= it.begin:
                merged.remove(before)
                span = min(before.begin, it.begin), max(before.end, it.end)
                it = _Meeting(*span, before.members | it.members)
        merged.append(it)
    return sorted(merged, key=lambda it: (it.begin, it.end, sorted(it.members)))
