"""A small set of people who explain the foreground, and their runners-up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracking.boxes import iou
from tracking.detectors.base import Plane
from tracking.detectors.boxfilter import Peaks
from tracking.detectors.silhouette import covered, integral, sums_at


@dataclass(frozen=True, slots=True)
class ExplainSettings:
    """Which hypotheses of a frame are handed on."""

    use: bool = True  # false: the boxes as the scan found them, each by itself (the paper)
    most_people: int = 10  # people that a frame's foreground is explained by at most
    least_share: float = (
        0.3  # least gain of a further person, in areas of the part of the body that nobody covers
    )
    most_hypotheses: int = 16  # K: hypotheses handed on at most, people and runners-up
    apart: float = 0.55  # runners-up overlap (IoU) what is handed on already by less than this


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """Hypotheses `(K, 4)` in cells; scores `(K,)` in [0, 1]; the first `people` explain the foreground.

    Where nothing was explained, all of them may be people, and `people` is at least as many as there are.
    """

    boxes: npt.NDArray[np.float64]
    scores: npt.NDArray[np.float64]
    people: int


def explain(
    peaks: Peaks, foreground: Plane, cost: Plane, weight: Plane, settings: ExplainSettings
) -> Explanation:
    """Choose the people who explain most, one after the other, move each of them, then add runners-up.

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
    search = _Search(peaks, foreground, cost, weight, settings)
    chosen = search.people() if settings.use else []
    shares = search.shares(chosen)
    scores = [float(search.shares([other for other in chosen if other != k])[k]) for k in chosen]
    people = len(chosen) if settings.use else settings.most_hypotheses
    for index in _runners_up(peaks.boxes, chosen, settings):
        chosen.append(index)
        scores.append(float(shares[index]))
    return Explanation(peaks.boxes[chosen].reshape(-1, 4), np.clip(scores, 0.0, 1.0), people)


# How often each person is looked for again, given the others: the first choice was made without them.
_MOVES = 2


# A body of which less is visible than this share counts as if so much were: a hand proves nobody.
_LEAST_VISIBLE = 0.6


class _Search:
    """Greedy choice, then moves and removals."""

    def __init__(
        self,
        peaks: Peaks,
        foreground: Plane,
        cost: Plane,
        weight: Plane,
        settings: ExplainSettings,
    ) -> None:
        self._peaks = peaks
        self._foreground = foreground
        self._cost = cost
        self._weight = weight
        self._size = np.maximum(sums_at(integral(weight), peaks.boxes, peaks.body), 1.0)
        self._settings = settings

    def people(self) -> list[int]:
        """Give the indices of the chosen, in the order in which they were first chosen."""
        chosen: list[int] = []
        while len(chosen) < min(self._settings.most_people, self._settings.most_hypotheses):
            best = self._best(chosen)
            if best is None:
                break
            chosen.append(best)
        for _ in range(_MOVES):
            before = list(chosen)
            for index in before:
                others = [other for other in chosen if other != index]
                best = self._best(others)
                place = chosen.index(index)
                chosen[place : place + 1] = [] if best is None else [best]
            if chosen == before:
                break
        return chosen

    def shares(self, chosen: list[int]) -> npt.NDArray[np.float64]:
        """Give each candidate's gain beside the chosen, in areas of its body, `(P,)`."""
        left, free = self._foreground - self._cost, self._weight.copy()
        for index in chosen:
            hidden = covered(left.shape, self._peaks.boxes[index], self._peaks.body)
            left[hidden] = np.minimum(left[hidden], 0.0)
            free[hidden] = 0.0
        gains = sums_at(integral(left), self._peaks.boxes, self._peaks.body)
        visible = sums_at(integral(free), self._peaks.boxes, self._peaks.body)
        return np.asarray(self._peaks.priors * gains / np.maximum(visible, _LEAST_VISIBLE * self._size))

    def _best(self, chosen: list[int]) -> int | None:
        """Give the candidate that gains most beside the chosen; `None` where none gains enough."""
        if not len(self._size):
            return None
        shares = self.shares(chosen)
        gains = np.where(shares >= self._settings.least_share, shares * self._size, -np.inf)
        gains[chosen] = -np.inf
        best = int(np.argmax(gains))
        return best if np.isfinite(gains[best]) else None


def _runners_up(boxes: npt.NDArray[np.float64], chosen: list[int], settings: ExplainSettings) -> list[int]:
    """Give the next best candidates that differ enough from each other and from the chosen."""
    taken = list(chosen)
    extra: list[int] = []
    for index in range(len(boxes)):
        if len(taken) >= settings.most_hypotheses:
            break
        if index not in chosen and iou(boxes[taken], boxes[index]).max(initial=0.0) < settings.apart:
            taken.append(index)
            extra.append(index)
    return extra
