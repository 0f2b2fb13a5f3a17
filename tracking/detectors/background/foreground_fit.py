"""Foreground fit: a small set of people that explains the foreground, and alternatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracking.boxes import iou
from tracking.detectors.background.box_filter import ScanPeaks
from tracking.detectors.background.silhouette import PartRectangles, integral_image
from tracking.detectors.base import Plane


@dataclass(frozen=True, slots=True)
class ForegroundFitSettings:
    """Which hypotheses of a frame become detections."""

    enabled: bool = True  # false: all boxes of the scan, independently (the paper)
    max_people: int = 40  # most people selected per frame
    max_people_uncalibrated: int = 10  # the same while the height model is not reliable
    min_gain: float = 0.3  # least gain of a person, as a share of the visible body area
    max_hypotheses: int = 16  # K: detections per frame, people and alternatives, if people are few
    max_alternatives: int = 8  # most alternatives if people are many
    max_iou: float = 0.55  # largest overlap (IoU) of an alternative with another detection


@dataclass(frozen=True, slots=True, eq=False)
class PersonHypotheses:
    """The people that explain a frame's foreground, then alternatives to them.

    Attributes:
        boxes: `(K, 4)` in cells.
        scores: `(K,)` in [0, 1].
        person_count: the first so many explain the foreground. Without a fit any of the boxes may be a
            person, and it is at least K.
    """

    boxes: npt.NDArray[np.float64]
    scores: npt.NDArray[np.float64]
    person_count: int


def fit_foreground(
    peaks: ScanPeaks, foreground: Plane, cost: Plane, weight: Plane, settings: ForegroundFitSettings
) -> PersonHypotheses:
    """Select people whose bodies explain the foreground, refine each, then add alternatives.

    The gain of a body is the foreground inside that no selected body covers, minus the background inside (a
    linear form of the log-likelihood `P(foreground) = 1 - (1 - e) prod (1 - t_k)`). The score of a person is
    this gain given all others, divided by the area of the body that they do not cover. The score of an
    alternative is its gain given the selected people, so that a second box on a person scores near 0.

    Args:
        peaks: candidates, in cells.
        foreground: share of foreground per cell, `(H, W)`.
        cost: cost of the background in each cell to a covering body, `(H, W)`.
        weight: 1 in visible cells, `(H, W)`.
        settings: limits and thresholds.
    """
    search = GreedySearch(peaks, foreground, cost, weight, settings)
    chosen = search.select_people() if settings.enabled else []
    shares = search.gain_per_visible_area()
    scores = []
    for index in chosen:
        search.remove(index)
        scores.append(float(search.gain_per_visible_area()[index]))
        search.add(index)
    person_count = len(chosen) if settings.enabled else settings.max_hypotheses
    for index in select_alternatives(peaks.boxes, chosen, settings):
        chosen.append(index)
        scores.append(float(shares[index]))
    return PersonHypotheses(peaks.boxes[chosen].reshape(-1, 4), np.clip(scores, 0.0, 1.0), person_count)


# Rounds in which each person is selected again given all others.
_REFINEMENTS = 2


# Least visible share of a body used in its score: a visible hand is no evidence of a person.
_MIN_VISIBLE = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class _Cover:
    """What a candidate covers.

    Attributes:
        bounds: the rows and columns that it spans.
        inside: its cells in them.
        near: the candidates that reach into them.
        parts: of these, relative to the bounds.
    """

    bounds: tuple[slice, slice]
    inside: npt.NDArray[np.bool_]
    near: npt.NDArray[np.int64]
    parts: PartRectangles


class GreedySearch:
    """Greedy selection, then refinement of each selected candidate.

    Attributes:
        gains: `(P,)`, the gain of each candidate given the selected ones.
        visible: `(P,)`, the cells of each that no selected one covers.
    """

    def __init__(
        self, peaks: ScanPeaks, foreground: Plane, cost: Plane, weight: Plane, settings: ForegroundFitSettings
    ) -> None:
        self._peaks = peaks
        self._settings = settings
        self.gains = peaks.gains.copy()
        self.visible = peaks.areas.copy()
        # What a cell adds to the gain and to the visible area of a body until another one covers it.
        self._cell_values = np.stack([np.maximum(foreground - cost, 0.0), weight], axis=-1)
        self._cover_counts = np.zeros(weight.shape, dtype=np.int32)
        self._extent = peaks.parts.extent
        self._covers: dict[int, _Cover] = {}

    def select_people(self) -> list[int]:
        """Select people greedily; return their indices in the order of selection."""
        chosen: list[int] = []
        while len(chosen) < self._settings.max_people:
            best = self._best(chosen)
            if best is None:
                break
            chosen.append(best)
            self.add(best)
        for _ in range(_REFINEMENTS):
            before = list(chosen)
            for index in before:
                self.remove(index)
                best = self._best([other for other in chosen if other != index])
                position = chosen.index(index)
                chosen[position : position + 1] = [] if best is None else [best]
                if best is not None:
                    self.add(best)
            if chosen == before:
                break
        return chosen

    def gain_per_visible_area(self) -> npt.NDArray[np.float64]:
        """Return each candidate's gain per visible body area given the selected, `(P,)`."""
        least = _MIN_VISIBLE * self._peaks.areas
        return np.asarray(self._peaks.gain_factors * self.gains / np.maximum(self.visible, least))

    def selection_gains(self) -> npt.NDArray[np.float64]:
        """Return what selecting each candidate gains, `(P,)`; -inf: too little."""
        shares = self.gain_per_visible_area()
        return np.where(shares >= self._settings.min_gain, shares * self._peaks.areas, -np.inf)

    def add(self, index: int) -> None:
        """Add a candidate to the selected: it covers its cells."""
        cover = self._cover(index)
        counts = self._cover_counts[cover.bounds]
        self._update(cover, cover.inside & (counts == 0), -1.0)
        counts += cover.inside

    def remove(self, index: int) -> None:
        """Remove a candidate from the selected."""
        cover = self._cover(index)
        counts = self._cover_counts[cover.bounds]
        counts -= cover.inside
        self._update(cover, cover.inside & (counts == 0), 1.0)

    def _update(self, cover: _Cover, cells: npt.NDArray[np.bool_], sign: float) -> None:
        """Update gains and visible areas of the bodies that overlap the changed cells."""
        changed = integral_image(self._cell_values[cover.bounds] * cells[..., None].astype(np.float32))
        change = cover.parts.sums(changed)
        self.gains[cover.near] += sign * change[:, 0]
        self.visible[cover.near] += sign * change[:, 1]

    def _cover(self, index: int) -> _Cover:
        """Return what a candidate covers; each is added and removed several times."""
        if index not in self._covers:
            bounds = self._peaks.parts.bounds(index)
            (top, bottom), (left, right) = ((span.start, span.stop) for span in bounds)
            lefts, tops, rights, bottoms = self._extent
            near = np.flatnonzero((lefts < right) & (rights > left) & (tops < bottom) & (bottoms > top))
            parts = self._peaks.parts.select(near).clip_to(bounds)
            self._covers[index] = _Cover(bounds, self._peaks.parts.mask(index), near, parts)
        return self._covers[index]

    def _best(self, chosen: list[int]) -> int | None:
        """Return the candidate with the largest gain given the selected, or `None` if none gains enough."""
        if not len(self.gains):
            return None
        gains = self.selection_gains()
        gains[chosen] = -np.inf
        best = int(np.argmax(gains))
        return best if np.isfinite(gains[best]) else None


def select_alternatives(
    boxes: npt.NDArray[np.float64], chosen: list[int], settings: ForegroundFitSettings
) -> list[int]:
    """Return the next best candidates that overlap neither each other nor the selected too much."""
    if not len(boxes):
        return []
    overlaps = iou(boxes[:, None], boxes[None])
    nearest = overlaps[chosen].max(axis=0, initial=0.0)
    nearest[chosen] = np.inf
    alternatives: list[int] = []
    limit = settings.max_hypotheses
    if settings.enabled:
        limit = max(limit, len(chosen) + settings.max_alternatives)
    for index in range(len(boxes)):
        if len(chosen) + len(alternatives) >= limit:
            break
        if nearest[index] < settings.max_iou:
            alternatives.append(index)
            nearest = np.maximum(nearest, overlaps[index])
    return alternatives


# Largest share of its width or height that a box loses on each side: the scan is more accurate than that.
_MAX_TRIM = 0.12
# A row or column with less than this share of foreground is outside.
_MIN_FILL = 0.04


def shrink_to_foreground(
    boxes: npt.NDArray[np.float64], foreground: Plane, weight: Plane
) -> npt.NDArray[np.float64]:
    """Move each side of each box `(K, 4)` in cells inwards to where the foreground begins.

    Sides in ignored cells (`weight` 0) are not moved.
    """
    fitted = boxes.copy()
    filled = np.where(weight > 0, foreground, 1.0)
    for row, box in enumerate(boxes):
        left, top, right, bottom = (round(edge) for edge in box)
        inside = filled[top:bottom, left:right]
        if inside.size == 0:
            continue
        across, down = inside.mean(axis=0), inside.mean(axis=1)
        fitted[row] += (_trim(across), _trim(down), -_trim(across[::-1]), -_trim(down[::-1]))
    return fitted


def _trim(profile: npt.NDArray[np.float32]) -> int:
    """Return how many cells can be trimmed at the start of a profile."""
    limit = int(_MAX_TRIM * len(profile))
    filled = np.flatnonzero(profile[: limit + 1] >= _MIN_FILL)
    return int(filled[0]) if filled.size else 0
