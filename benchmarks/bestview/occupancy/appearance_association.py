"""Identity assignment after people met: paths ignore appearance, so ids are reassigned by color.

The occupancy map says that a person is there, not who. Where paths meet, the shortest ones go straight on or
swap by chance. As in Fleuret et al. (section 4) each person has a color model in each camera, learned where
they stand apart; after a meeting ids go to the paths with the most similar appearance.
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
    """When people meet, and when their ids are swapped afterwards.

    Attributes:
        near: distance of a meeting, in person heights.
        margin: Bhattacharyya distance by which a swap must be better than keeping the ids.
        least_pixels: unoccluded foreground in one camera from which its histogram counts.
        most_frames: frames after a meeting over which appearance is accumulated.
    """

    near: float = 0.4
    margin: float = 0.02
    least_pixels: float = 500.0
    most_frames: int = 250


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
        """Return the mean Bhattacharyya distance over the cameras that saw both; NaN: none did."""
        known = (self.pixels >= least) & (other.pixels >= least)
        if not known.any():
            return float("nan")
        one = self.rows[known] / self.pixels[known][:, None]
        two = other.rows[known] / other.pixels[known][:, None]
        similarity = np.sqrt(one * two).sum(axis=1)
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
            end = min(next(later, paths[path].end), meeting.end + settings.most_frames)
            after = paths[path].sum_over(meeting.end, end)
            distance[:, column] = [known[number].distance(after, settings.least_pixels) for number in ids]
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
        it = meeting
        for before in list(merged):
            if before.members & it.members and before.end >= it.begin:
                merged.remove(before)
                span = min(before.begin, it.begin), max(before.end, it.end)
                it = _Meeting(*span, before.members | it.members)
        merged.append(it)
    return sorted(merged, key=lambda meeting: (meeting.begin, meeting.end, sorted(meeting.members)))
