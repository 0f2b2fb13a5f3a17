"""Foreground fit: a small set of people that explains the foreground, and alternatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracking.boxes import iou
from tracking.detectors.background.box_filter import ScanPeaks
from tracking.detectors.background.silhouette import integral_image
from tracking.detectors.base import Plane


@dataclass(frozen=True, slots=True)
class ForegroundFitSettings:
    """Which hypotheses of a frame become detections."""

    enabled: bool = True  # false: all boxes of the scan, each by itself (the paper)
    max_people: int = 40  # people selected per frame at most
    max_people_uncalibrated: int = 10  # the same while the height model is unreliable
    min_gain: float = 0.3  # least gain of a further person, in visible body areas
    max_hypotheses: int = 16  # K: detections per frame, people and alternatives, where people are few
    max_alternatives: int = 8  # alternatives beside the people, however many these are
    max_iou: float = 0.55  # largest overlap (IoU) of an alternative with another detection


@dataclass(frozen=True, slots=True, eq=False)
class ForegroundFit:
    """Hypotheses `(K, 4)` in cells; scores `(K,)` in [0, 1]; the first `people` explain the foreground.

    Where nothing was explained, all of them may be people, and `people` is at least as many as there are.
    """

    boxes: npt.NDArray[np.float64]
    scores: npt.NDArray[np.float64]
    people: int


def fit_foreground(
    peaks: ScanPeaks, foreground: Plane, cost: Plane, weight: Plane, settings: ForegroundFitSettings
) -> ForegroundFit:
    """Select people whose bodies explain the foreground, refine each, then add alternatives.

    The gain of a body is the foreground inside that nobody explains yet, less the background inside (a
    linear form of the log-likelihood `P(foreground) = 1 - (1 - e) prod (1 - t_k)`). The score of a
    person is that gain, beside all the others, over the part of the body that none of them covers; of a
    runner-up, what the people leave to it, so that a second box on the same person scores near 0.

    Args:
        peaks: candidates, in cells.
        foreground: share of foreground per cell, `(H, W)`.
        cost: what each cell costs a body that covers it for the background in it, `(H, W)`.
        weight: 1 where the picture counts, `(H, W)`.
        settings: how many.
    """
    search = GreedySearch(peaks, foreground, cost, weight, settings)
    chosen = search.select_people() if settings.enabled else []
    shares = search.gain_per_area()
    scores = []
    for index in chosen:
        search.remove(index)
        scores.append(float(search.gain_per_area()[index]))
        search.add(index)
    people = len(chosen) if settings.enabled else settings.max_hypotheses
    for index in _alternatives(peaks.boxes, chosen, settings):
        chosen.append(index)
        scores.append(float(shares[index]))
    return ForegroundFit(peaks.boxes[chosen].reshape(-1, 4), np.clip(scores, 0.0, 1.0), people)


# How often each person is looked for again, given the others: the first choice was made without them.
_REFINEMENTS = 2


# A body of which less is visible than this share counts as if so much were: a hand proves nobody.
_MIN_VISIBLE = 0.6


class GreedySearch:
    """Greedy selection, then refinement of each selected candidate.

    Attributes:
        gains: `(P,)`, what each candidate gains beside the chosen.
        visible: `(P,)`, cells of it that none of them covers.
    """

    def __init__(
        self, peaks: ScanPeaks, foreground: Plane, cost: Plane, weight: Plane, settings: ForegroundFitSettings
    ) -> None:
        self._peaks = peaks
        self._settings = settings
        self.gains = peaks.gains.copy()
        self.visible = peaks.areas.copy()
        # What a covered cell no longer adds to the gain of the others, and to what is visible of them.
        self._cell_values = np.stack([np.maximum(foreground - cost, 0.0), weight], axis=-1)
        self._cover_counts = np.zeros(weight.shape, dtype=np.int32)
        self._extent = peaks.parts.extent

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
                place = chosen.index(index)
                chosen[place : place + 1] = [] if best is None else [best]
                if best is not None:
                    self.add(best)
            if chosen == before:
                break
        return chosen

    def gain_per_area(self) -> npt.NDArray[np.float64]:
        """Return each candidate's gain per visible body area beside the selected, `(P,)`."""
        least = _MIN_VISIBLE * self._peaks.areas
        return np.asarray(self._peaks.priors * self.gains / np.maximum(self.visible, least))

    def add(self, index: int) -> None:
        """Add a candidate to the selected: it covers its cells."""
        place, inside = self._peaks.parts.bounds(index), self._peaks.parts.mask(index)
        self._update(place, inside & (self._cover_counts[place] == 0), -1.0)
        self._cover_counts[place] += inside

    def remove(self, index: int) -> None:
        """Remove a candidate from the selected."""
        place, inside = self._peaks.parts.bounds(index), self._peaks.parts.mask(index)
        self._cover_counts[place] -= inside
        self._update(place, inside & (self._cover_counts[place] == 0), 1.0)

    def _update(self, place: tuple[slice, slice], cells: npt.NDArray[np.bool_], sign: float) -> None:
        """Update gains and visible areas of the bodies that overlap the changed cells."""
        lost = integral_image(self._cell_values[place] * cells[..., None].astype(np.float32))
        (top, bottom), (left, right) = ((it.start, it.stop) for it in place)
        lefts, tops, rights, bottoms = self._extent
        near = np.flatnonzero((lefts < right) & (rights > left) & (tops < bottom) & (bottoms > top))
        change = self._peaks.parts.select(near).clip_to(place).sums(lost)
        self.gains[near] += sign * change[:, 0]
        self.visible[near] += sign * change[:, 1]

    def _best(self, chosen: list[int]) -> int | None:
        """Return the candidate with the largest gain beside the selected; `None` where none gains enough."""
        if not len(self.gains):
            return None
        shares = self.gain_per_area()
        gains = np.where(shares >= self._settings.min_gain, shares * self._peaks.areas, -np.inf)
        gains[chosen] = -np.inf
        best = int(np.argmax(gains))
        return best if np.isfinite(gains[best]) else None


def _alternatives(
    boxes: npt.NDArray[np.float64], chosen: list[int], settings: ForegroundFitSettings
) -> list[int]:
    """Return the next best candidates that overlap neither each other nor the selected too much."""
    if not len(boxes):
        return []
    overlaps = iou(boxes[:, None], boxes[None])
    nearest = overlaps[chosen].max(axis=0, initial=0.0)
    nearest[chosen] = np.inf
    extra: list[int] = []
    most = settings.max_hypotheses
    if settings.enabled:
        most = max(most, len(chosen) + settings.max_alternatives)
    for index in range(len(boxes)):
        if len(chosen) + len(extra) >= most:
            break
        if nearest[index] < settings.max_iou:
            extra.append(index)
            nearest = np.maximum(nearest, overlaps[index])
    return extra


# A box loses at most this share of its width or height on each side: in a group there is always
# somebody's foreground at the border, and alone the scan is never that far off.
_MOST_TRIM = 0.12
# A row or column with less than this share of foreground is outside.
_LEAST_FILL = 0.04


def shrink_to_foreground(
    boxes: npt.NDArray[np.float64], foreground: Plane, weight: Plane
) -> npt.NDArray[np.float64]:
    """Move each side of each box `(K, 4)` in cells inwards to where the foreground begins.

    Sides that lie in ignored cells (`weight` 0) stay.
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
    most = int(_MOST_TRIM * len(profile))
    full = np.flatnonzero(profile[: most + 1] >= _LEAST_FILL)
    return int(full[0]) if full.size else 0
