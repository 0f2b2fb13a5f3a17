"""Explanation of a frame by people: network boxes and silhouettes are hypotheses of the same foreground fit.

Each hypothesis has the log-odds that it is a person,

    bias + silhouette s + network n    or, without a network box,    bias + silhouette s + unsupported,

with `s` its gain per visible body area given the selected people, and `n` the log-odds of the best network
box near it that no selected person claims yet. The search is that of the foreground fit, since log-odds and
gains differ by a factor only: what a network box says of a hypothesis is added to its gain. A person claims
the box that supports them, so that it does not speak for a neighbor, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats, iou
from tracking.detectors.background.box_filter import ScanPeaks
from tracking.detectors.background.detector import ForegroundScan
from tracking.detectors.background.foreground_fit import (
    ForegroundFitSettings,
    GreedySearch,
    select_alternatives,
    shrink_to_foreground,
)
from tracking.detectors.background.silhouette import Body, body_rectangles, integral_image
from tracking.detectors.fused.still_silhouettes import StillSilhouettes

_MIN_SUPPORT = 0.5
"""Least overlap (IoU) of a hypothesis with the network box that supports it."""
_REPLACING_SHARE, _REPLACING_OVERLAP = 0.2, 0.1
"""Probability that an alternative is right if the person it overlaps (IoU) by at least so much is not.

Without it, alternatives in crowds are right somewhat more often than their probability says.
"""
_NO_BOX = -1
_MIN_PROBABILITY, _MAX_PROBABILITY = 0.01, 0.99
"""Limits of the network's scores: log-odds beyond would outweigh all else."""


@dataclass(frozen=True, slots=True)
class FusionWeights:
    """Weights of the log-odds that a hypothesis is a person.

    Fitted by logistic regression on the first half of two recorded views, with two networks.
    """

    bias: float = -1.2
    silhouette: float = 5.5  # of the gain per visible body area
    network: float = 0.7  # of the network's log-odds
    unsupported: float = -3.4  # of a hypothesis without a network box


@dataclass(frozen=True, slots=True, eq=False)
class NetworkBoxes:
    """Boxes of a network `(N, 4)` and their log-odds `(N,)`."""

    boxes: Floats
    log_odds: Floats

    def __len__(self) -> int:
        return len(self.boxes)


@dataclass(frozen=True, slots=True, eq=False)
class FusedHypotheses:
    """The people that explain a frame, then alternatives to them.

    Attributes:
        boxes: `(K, 4)` in cells.
        log_odds: `(K,)`, that each is a person.
        person_count: the first so many explain the frame.
        supports: `(K,)`, the index of the network box that supports each, or -1.
        silhouettes: `(K,)`, the gain per visible body area of each.
    """

    boxes: Floats
    log_odds: Floats
    person_count: int
    supports: npt.NDArray[np.int64]
    silhouettes: Floats


class FusedSearch(GreedySearch):
    """The foreground fit's search, with the network's support of each candidate as additional gain."""

    def __init__(
        self,
        candidates: ScanPeaks,
        network: NetworkBoxes,
        scan: ForegroundScan,
        settings: ForegroundFitSettings,
        weights: FusionWeights,
        min_log_odds: float,
        penalties: Floats,
    ) -> None:
        """Start without people; the first candidates are the network's boxes, in cells."""
        super().__init__(candidates, scan.foreground, scan.cost, scan.weight, settings)
        self._min_log_odds = min_log_odds
        self._weights = weights
        overlaps = iou(candidates.boxes[:, None], network.boxes[None])
        said = weights.network * network.log_odds[None]
        # The last column stands for no box.
        self._support = np.full((len(candidates.boxes), len(network) + 1), weights.unsupported)
        self._support[:, -1] -= penalties
        self._support[:, :-1] = np.where(overlaps >= _MIN_SUPPORT, said, -np.inf)
        # A box says the same of a large and of a small silhouette: it counts with its own area.
        self._support_areas = np.tile(candidates.areas[:, None], (1, len(network) + 1))
        self._support_areas[:, :-1] = candidates.areas[: len(network)]
        self._free = np.ones(len(network) + 1, dtype=np.bool_)
        # Boxes that overlap so much are of one person.
        self._doubles = iou(network.boxes[:, None], network.boxes[None]) >= settings.max_iou
        self._claims: dict[int, npt.NDArray[np.int64]] = {}

    def log_odds(self) -> Floats:
        """Return the log-odds of each candidate given the selected, `(P,)`."""
        return self._log_odds(
            self.gain_per_visible_area(), np.where(self._free, self._support, -np.inf).max(axis=1)
        )

    def selection_gains(self) -> Floats:
        """Return what selecting each candidate gains, `(P,)`, in cells of foreground; -inf: too little."""
        support = np.where(self._free, self._support, -np.inf)
        best = support.argmax(axis=1)
        rows = np.arange(len(best))
        shares, strongest = self.gain_per_visible_area(), support[rows, best]
        gains = shares * self._peaks.areas
        gains += strongest / self._weights.silhouette * self._support_areas[rows, best]
        return np.where(self._log_odds(shares, strongest) >= self._min_log_odds, gains, -np.inf)

    def _log_odds(self, shares: Floats, support: Floats) -> Floats:
        """Return the log-odds by the gains per visible area and what the network says, both `(P,)`."""
        return np.asarray(self._weights.bias + self._weights.silhouette * shares + support)

    def supporting_box(self, index: int) -> int:
        """Return the free network box that supports a candidate most, or -1."""
        best = int(np.argmax(np.where(self._free, self._support[index], -np.inf)))
        return best if best < len(self._free) - 1 else _NO_BOX

    def add(self, index: int) -> None:
        """Add a candidate to the selected: it covers its cells and claims its network box."""
        super().add(index)
        supporting = self.supporting_box(index)
        claimed = np.empty(0, dtype=np.int64)
        if supporting != _NO_BOX:
            claimed = np.flatnonzero(self._doubles[supporting] & self._free[:-1])
        self._claims[index] = claimed
        self._free[claimed] = False

    def remove(self, index: int) -> None:
        """Remove a candidate from the selected."""
        super().remove(index)
        self._free[self._claims.pop(index)] = True


def explain_frame(
    scan: ForegroundScan,
    network: NetworkBoxes,
    body: Body,
    settings: ForegroundFitSettings,
    weights: FusionWeights,
    min_log_odds: float,
    still: StillSilhouettes,
) -> FusedHypotheses:
    """Select the people that explain a frame, then alternatives.

    Args:
        scan: the foreground and its silhouettes.
        network: the network's boxes, in cells.
        body: the shape of a person inside of a box.
        settings: limits of the foreground fit.
        weights: weights of the log-odds.
        min_log_odds: least log-odds of a person.
        still: silhouettes that are hardly people.
    """
    candidates = join_candidates(scan, network.boxes, body)
    search = FusedSearch(
        candidates, network, scan, settings, weights, min_log_odds, still.penalties(candidates.boxes)
    )
    chosen = search.select_people()
    alternative_odds, alternative_shares = search.log_odds(), search.gain_per_visible_area()
    log_odds, supports, shares = [], [], []
    for index in chosen:
        search.remove(index)
        log_odds.append(float(search.log_odds()[index]))
        shares.append(float(search.gain_per_visible_area()[index]))
        supports.append(search.supporting_box(index))
        search.add(index)
    person_count = len(chosen)
    for index in select_alternatives(candidates.boxes, chosen, settings):
        chosen.append(index)
        log_odds.append(float(alternative_odds[index]))
        shares.append(float(alternative_shares[index]))
        supports.append(search.supporting_box(index))
    boxes = shrink_to_foreground(candidates.boxes[chosen].reshape(-1, 4), scan.foreground, scan.weight)
    return FusedHypotheses(
        boxes,
        consider_wrong_people(boxes, np.array(log_odds), person_count),
        person_count,
        np.array(supports, dtype=np.int64),
        np.array(shares),
    )


def consider_wrong_people(boxes: Floats, log_odds: Floats, person_count: int) -> Floats:
    """Return log-odds `(K,)` by which alternatives may be right where a selected person is not.

    The log-odds of alternatives are given that all of the selected are people.

    Args:
        boxes: `(K, 4)`, of the people and then the alternatives.
        log_odds: `(K,)`, of each.
        person_count: number of people.
    """
    people, alternatives = np.split(to_probability(log_odds), [person_count])
    overlaps = iou(boxes[person_count:, None], boxes[None, :person_count]) >= _REPLACING_OVERLAP
    doubts = np.where(overlaps, 1.0 - people, 0.0).max(axis=1, initial=0.0)
    replacing = alternatives + (1.0 - alternatives) * _REPLACING_SHARE * doubts
    return np.concatenate([log_odds[:person_count], np.log(replacing / (1.0 - replacing))])


def join_candidates(scan: ForegroundScan, boxes: Floats, body: Body) -> ScanPeaks:
    """Return network boxes `(N, 4)` as candidates, and behind them the silhouettes."""
    peaks = scan.peaks
    parts = body_rectangles(boxes, body, (scan.weight.shape[0], scan.weight.shape[1]))
    return ScanPeaks(
        np.concatenate([boxes, peaks.boxes]),
        np.concatenate([parts.sums(integral_image(scan.foreground - scan.cost)), peaks.gains]),
        np.concatenate([np.maximum(parts.sums(integral_image(scan.weight)), 1.0), peaks.areas]),
        np.concatenate([np.ones(len(boxes)), peaks.gain_factors]),
        parts.followed_by(peaks.parts),
    )


def to_log_odds(probabilities: Floats) -> Floats:
    """Return the logarithms of the odds, within limits."""
    clipped = np.clip(probabilities, _MIN_PROBABILITY, _MAX_PROBABILITY)
    return np.asarray(np.log(clipped / (1.0 - clipped)))


def to_probability(log_odds: Floats) -> Floats:
    """Return the probabilities of log-odds."""
    return np.asarray(1.0 / (1.0 + np.exp(-log_odds)))
