"""Identity assignment by color after people meet, since the paths ignore appearance.

The occupancy map does not identify people: where paths meet, the shortest paths may swap people. As in
Fleuret et al. (section 4), each person has a color model per camera, learned while they are apart; after a
meeting, ids are assigned to the paths with the most similar appearance.
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
    """Parameters of meetings, and of swapping ids after them.

    Attributes:
        near: distance of a meeting, in person heights.
        margin: Bhattacharyya distance by which a swap must be better than keeping the ids.
        min_pixels: unoccluded foreground in one camera from which its histogram counts.
        max_frames: frames after a meeting over which appearance is accumulated.
    """

    near: float = 0.4
    margin: float = 0.02
    min_pixels: float = 500.0
    max_frames: int = 250


@dataclass(frozen=True, slots=True, eq=False)
class PathAppearance:
    """A path on the ground and its appearance.

    Attributes:
        first: its first frame.
        places: (F, 2) on the ground.
        histograms: (F, C, B) color histograms in each camera, rows summing to 1.
        pixels: (F, C) pixels in each histogram; 0: unknown.
    """

    first: int
    places: Floats
    histograms: NDArray[np.float32]
    pixels: NDArray[np.float32]

    @property
    def end(self) -> int:
        """The frame after its last."""
        return self.first + len(self.places)

    def sum_over(self, begin: int, end: int) -> _AppearanceSums:
        """Sum the histograms over a span of frames."""
        span = slice(max(begin - self.first, 0), max(end - self.first, 0))
        pixels = self.pixels[span].astype(np.float64)
        return _AppearanceSums((self.histograms[span] * pixels[..., None]).sum(axis=0), pixels.sum(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class _AppearanceSums:
    """Sums over frames: (C, B) histograms weighted by pixels, (C,) pixels."""

    rows: Floats
    pixels: Floats

    def plus(self, other: _AppearanceSums) -> _AppearanceSums:
        return _AppearanceSums(self.rows + other.rows, self.pixels + other.pixels)

    def distance(self, other: _AppearanceSums, least: float) -> float:
        """Return the mean Bhattacharyya distance over the cameras with both; NaN without any."""
        known = (self.pixels >= least) & (other.pixels >= least)
        if not known.any():
            return float("nan")
        first = self.rows[known] / self.pixels[known][:, None]
        second = other.rows[known] / other.pixels[known][:, None]
        similarity = np.sqrt(first * second).sum(axis=1)
        return float(np.sqrt(np.maximum(1.0 - similarity, 0.0)).mean())


@dataclass(frozen=True, slots=True)
class _Meeting:
    """The paths that met, and the frames from `begin` up to, not including, `end`."""

    begin: int
    end: int
    members: frozenset[int]


def assign_ids(paths: Sequence[PathAppearance], person: float, settings: MeetingSettings) -> list[Ints]:
    """Return each path's id (F,) in each of its frames.

    Args:
        paths: the paths with their appearance.
        person: a person's height in ground units.
        settings: of meetings.
    """
    numbers = [np.full(len(path.places), place + 1, dtype=np.int64) for place, path in enumerate(paths)]
    known = [
        _AppearanceSums(np.zeros(path.histograms.shape[1:]), np.zeros(path.pixels.shape[1:]))
        for path in paths
    ]
    last_seen = [path.first for path in paths]
    meetings = _meetings(paths, settings.near * person)
    for place, meeting in enumerate(meetings):
        continuing = sorted(
            member
            for member in meeting.members
            if paths[member].first < meeting.begin and paths[member].end > meeting.end
        )
        ids = [int(numbers[member][meeting.begin - 1 - paths[member].first]) - 1 for member in continuing]
        for path, number in zip(continuing, ids, strict=True):
            known[number] = known[number].plus(paths[path].sum_over(last_seen[path], meeting.begin))
        distance = np.full((len(continuing), len(continuing)), np.nan)
        for path in meeting.members:
            last_seen[path] = meeting.end
        for column, path in enumerate(continuing):
            later = (meeting.begin for meeting in meetings[place + 1 :] if path in meeting.members)
            end = min(next(later, paths[path].end), meeting.end + settings.max_frames)
            after = paths[path].sum_over(meeting.end, end)
            distance[:, column] = [known[number].distance(after, settings.min_pixels) for number in ids]
        if len(continuing) < 2 or np.isnan(distance).any():
            continue
        rows, columns = linear_sum_assignment(distance - settings.margin * np.eye(len(continuing)))
        for one, other in zip(rows.tolist(), columns.tolist(), strict=True):
            middle = (meeting.begin + meeting.end) // 2 - paths[continuing[other]].first
            numbers[continuing[other]][middle:] = ids[one] + 1
    return numbers


def _meetings(paths: Sequence[PathAppearance], near: float) -> list[_Meeting]:
    """Return the meetings in order: spans of frames with paths near each other, overlapping ones merged."""
    found: list[_Meeting] = []
    for one, first in enumerate(paths):
        for other, second in enumerate(paths[:one]):
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
    for meeting in sorted(found, key=lambda meeting: (meeting.begin, meeting.end, sorted(meeting.members))):
        union = meeting
        for before in list(merged):
            if before.members & union.members and before.end >= union.begin:
                merged.remove(before)
                span = min(before.begin, union.begin), max(before.end, union.end)
                union = _Meeting(*span, before.members | union.members)
        merged.append(union)
    return sorted(merged, key=lambda meeting: (meeting.begin, meeting.end, sorted(meeting.members)))
