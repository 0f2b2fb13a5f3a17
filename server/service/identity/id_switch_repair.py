"""Finds identity switches between two tracks of a camera in a revised window, and repairs person numbers."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bestview import IdentityRegistry, Split, TrackKey
from server.service.identity.camera_window import CameraWindow, WindowReader
from server.service.identity.track_parts import UNCONFIRMED, UNKNOWN, Parts, TrackPart, person_numbers
from server.service.ingest.window_history import HistorySpan


class IdSwitchRepair:
    """Applies windows that revise the past: exchanges the keys of tracks that had switched.

    A key stands for one continuous path: where a camera's two tracks exchange people, their keys are
    exchanged here, so that earlier evidence stays valid. From then on their person numbers are fixed.
    """

    def __init__(self, registry: IdentityRegistry, reader: WindowReader) -> None:
        self._registry, self._reader = registry, reader
        self._switches: dict[TrackKey, TrackPart] = {}
        """By track, the number it has since a switch, until the registry no longer revises that time."""

    def repair(
        self,
        window: CameraWindow,
        before: Sequence[HistorySpan[CameraWindow]],
        parts: Parts,
        needed_from: int,
    ) -> tuple[CameraWindow, list[Split]]:
        """Exchange the keys of tracks that had switched; return the window with current keys, and the splits.

        ``before`` are the earlier windows of its final frames. ``parts``, each track's person numbers, is
        updated in place; for frames before ``needed_from`` it may be incomplete.
        """
        splits: list[Split] = []
        for one, two, frame in find_id_switches(window, before):
            first, second = (
                _person_at(parts.get(key, UNKNOWN), frame - 1, needed_from) for key in (one, two)
            )
            self._reader.local_numbers.exchange(one, two)
            splits += self._registry.swap_tracks(one, two, frame, (first, second))
            if first and second and first != second:
                self._switches |= {one: TrackPart(frame, second), two: TrackPart(frame, first)}
                self.overlay(parts)
        return self._reader.with_current_keys(window), splits

    def overlay(self, parts: Parts) -> None:
        """Override the registry's numbers with those fixed by a switch."""
        for key, since in self._switches.items():
            if key not in parts:
                continue
            later = [part for part in parts[key] if part.first > since.first]
            parts[key] = [*(part for part in parts[key] if part.first < since.first), since, *later]

    def merge(self, merged: Mapping[int, int]) -> None:
        """Replace merged numbers."""
        self._switches = {
            key: TrackPart(part.first, merged.get(part.number, part.number))
            for key, part in self._switches.items()
        }

    def forget(self, numbers: Collection[int]) -> None:
        """Drop the switches of people who are forgotten."""
        self._switches = {key: since for key, since in self._switches.items() if since.number not in numbers}

    def keep_only(self, parts: Parts, needed_from: int) -> None:
        """Drop switches before the frames that are still needed."""
        self._switches = {
            key: since
            for key, since in self._switches.items()
            if key in parts and not any(since.first < part.first <= needed_from for part in parts[key])
        }


def _person_at(parts: Sequence[TrackPart], frame: int, needed_from: int) -> int:
    """Return a track's person number in a frame, or in the first frame still known; 0: unconfirmed."""
    if frame < parts[0].first <= needed_from:
        frame = parts[0].first
    number = int(person_numbers([parts], frame, 1)[0, 0])
    return 0 if number == UNCONFIRMED else number


Floats = NDArray[np.float64]

_SAME_IOU = 0.5
"""IoU from which two boxes are the same: a revision assigns the same detections to other tracks."""
_MIN_FRAMES = 2
"""Minimum number of frames in which each has the other's former boxes."""


class IdSwitch(NamedTuple):
    """Two tracks, and the first frame in which each follows the other's person."""

    one: TrackKey
    two: TrackKey
    frame: int


def find_id_switches(revised: CameraWindow, before: Sequence[HistorySpan[CameraWindow]]) -> list[IdSwitch]:
    """Compare the tracks of some frames with what was published of them before.

    Two tracks have switched where from some frame on each has the other's former boxes and neither its own.
    A cyclic switch of three tracks is not detected.

    Args:
        revised: the new window.
        before: the earlier windows of its final frames, in order; the first frames may be missing.
    """
    if not before:
        return []
    # A switch from the first known frame on began in a frame that is no longer known.
    first, last = max(revised.first, before[0].first), before[-1].last
    new = revised.boxes[:, first - revised.first : last - revised.first + 1]
    old = _published_boxes(revised.keys, before, first, last)
    same = _overlap(new[:, None], old[None]) > _SAME_IOU  # (T, T, F): track now, track before
    switches = []
    for one, two in combinations(range(len(revised.keys)), 2):
        unchanged = np.flatnonzero(same[one, one] | same[two, two])
        since = int(unchanged[-1]) + 1 if unchanged.size else 0
        count = int(min(same[one, two, since:].sum(), same[two, one, since:].sum()))
        if count >= _MIN_FRAMES:
            frame = first + since if unchanged.size else revised.first
            switches.append((-count, IdSwitch(revised.keys[one], revised.keys[two], frame)))
    # In a crowd a box overlaps several others: take the longest matches first, each track once.
    used: set[TrackKey] = set()
    selected = []
    for _, switch in sorted(switches):
        if used.isdisjoint((switch.one, switch.two)):
            used |= {switch.one, switch.two}
            selected.append(switch)
    return selected


def _published_boxes(
    keys: Sequence[TrackKey], published: Sequence[HistorySpan[CameraWindow]], first: int, last: int
) -> Floats:
    """Return the tracks' published boxes in the frames from `first` to `last`: (T, F, 4), NaN: hidden."""
    boxes = np.full((len(keys), last - first + 1, 4), np.nan)
    row = {key: n for n, key in enumerate(keys)}
    for span in published:
        rows = slice(span.first - span.window.first, span.last - span.window.first + 1)
        for key, path in zip(span.window.keys, span.window.boxes, strict=True):
            if key in row:
                boxes[row[key], span.first - first : span.last - first + 1] = path[rows]
    return boxes


def _overlap(one: Floats, two: Floats) -> Floats:
    """Return the IoU of boxes (..., 4); 0 where either is hidden (NaN)."""
    wide = np.minimum(one[..., 2], two[..., 2]) - np.maximum(one[..., 0], two[..., 0])
    high = np.minimum(one[..., 3], two[..., 3]) - np.maximum(one[..., 1], two[..., 1])
    intersection = np.maximum(wide, 0.0) * np.maximum(high, 0.0)
    areas = [(boxes[..., 2] - boxes[..., 0]) * (boxes[..., 3] - boxes[..., 1]) for boxes in (one, two)]
    union = areas[0] + areas[1] - intersection
    return np.asarray(
        np.divide(
            intersection, union, out=np.zeros(intersection.shape), where=(intersection > 0) & (union > 0)
        )
    )
