"""Isolated standing people in the foreground: the samples of the height model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Mask

# An isolated person's blob: width over height, filled share of its box, least height in image heights, and
# the margin in pixels to the border and to ignored areas.
_MIN_ASPECT, _MAX_ASPECT = 0.2, 0.55
_MIN_FILL = 0.4
_MIN_HEIGHT = 0.08
_MARGIN = 3
_MERGED_AREA = 0.05


@dataclass(frozen=True, slots=True)
class IsolatedPerson:
    """An isolated standing person, in pixels: center column, foot row and height."""

    center: float
    foot_row: float
    height: float


def find_isolated_people(foreground: Mask, visible: Mask) -> list[IsolatedPerson]:
    """Return every foreground blob that looks like one whole isolated standing person."""
    rows, columns = foreground.shape
    # Outlines are much faster than labeled pixels.
    outlines, _ = cv2.findContours(foreground, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    blobs = np.array([_blob(np.asarray(outline)) for outline in outlines], dtype=np.int64).reshape(-1, 5)
    found: list[IsolatedPerson] = []
    for label, (left, top, width, height, area) in enumerate(blobs.tolist()):
        upright = _MIN_ASPECT * height <= width <= _MAX_ASPECT * height and area >= _MIN_FILL * width * height
        inside = left >= _MARGIN and left + width <= columns - _MARGIN
        inside = inside and top >= _MARGIN and top + height <= rows - _MARGIN
        if not (upright and inside and height >= _MIN_HEIGHT * rows):
            continue
        around = visible[top - _MARGIN : top + height + _MARGIN, left - _MARGIN : left + width + _MARGIN]
        if around.all() and not _has_neighbor(blobs, label):
            found.append(IsolatedPerson(left + width / 2.0, float(top + height), float(height)))
    return found


def _blob(outline: npt.NDArray[Any]) -> tuple[int, ...]:
    """Return left, top, width, height and area of an outline, holes included."""
    around = cv2.arcLength(outline, True) / 2.0  # noqa: FBT003 — closed; adds half a pixel around the outline
    return (*cv2.boundingRect(outline), round(cv2.contourArea(outline) + around) + 1)


def _has_neighbor(blobs: npt.NDArray[np.int64], label: int) -> bool:
    """Return whether another large blob is near this one: probably parts of one person."""
    left, top, width, height, area = blobs[label].tolist()
    reach = height // 8
    others = np.delete(blobs, label, axis=0)
    others = others[others[:, 4] >= _MERGED_AREA * area]
    beside = (others[:, 0] > left + width + reach) | (others[:, 0] + others[:, 2] < left - reach)
    apart = (others[:, 1] > top + height + reach) | (others[:, 1] + others[:, 3] < top - reach)
    return bool((~(beside | apart)).any())


# Movement of center, foot or head, in person heights, after which a person counts as a new sample.
_STEP = 0.1
# Seconds after which a position without a person is dropped.
_MAX_AGE_S = 2.0
_ROUNDING = 1e-6


class SampleNoveltyFilter:
    """Drops samples of people who stand where a sample was taken recently."""

    def __init__(self) -> None:
        self._positions = np.empty((0, 3))
        self._ages = np.empty(0)
        """Seconds since a person was detected there."""

    def new_samples(self, people: Sequence[IsolatedPerson], elapsed_s: float) -> list[IsolatedPerson]:
        """Return the people who count as new samples; `elapsed_s` seconds have passed since the last call."""
        self._ages += elapsed_s
        new: list[IsolatedPerson] = []
        for person in people:
            position = np.array([person.center, person.foot_row, person.foot_row - person.height])
            same = np.abs(self._positions - position).max(axis=1, initial=0.0) <= _STEP * person.height
            self._ages[same] = 0.0
            if not same.any():
                new.append(person)
                self._positions = np.concatenate([self._positions, position[None]])
                self._ages = np.append(self._ages, 0.0)
        kept = self._ages <= _MAX_AGE_S + _ROUNDING
        self._positions, self._ages = self._positions[kept], self._ages[kept]
        return new
