"""Risk prediction from a solved window: expected and possible identity failures, and their probability."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tracking.appearance import appearance_distance_matrix
from tracking.boxes import Floats, dice_overlap
from tracking.interactive.lookahead import predict_crossings, predict_paths
from tracking.interactive.settings import ResolvedInteractiveSettings
from tracking.interactive.solved_window import SolvedWindow
from tracking.interactive.swap_margins import CheapestSwaps, find_cheapest_swaps
from tracking.model.settings import CostSettings
from tracking.types import RiskEvent, RiskReason

_MAX_MARGIN = 10.0
"""Upper limit of margins."""
_LEAD_SCALE = 10.0
"""Frames per unit of lead time."""
_MIN_OVERLAP = 0.25
"""Overlap (shared over average area) from which one object occludes another."""
_RECENT = 5
"""Least number of detections to extrapolate a score or a path."""


@dataclass(frozen=True, slots=True)
class RiskFeatures:
    """Features of the risk model.

    Attributes:
        margin: cost of the alternative solution above the chosen one.
        lead: frames from the newest one to the expected failure; negative: in the past.
        length: frames for which two objects overlap, or one is occluded.
    """

    margin: float
    lead: float
    length: float

    @property
    def regression_terms(self) -> tuple[float, float, float, float, float]:
        """Terms of the log odds: a constant, the margin, and terms for future and for past failures."""
        ahead = float(self.lead > 0.0)
        begun = math.log1p(self.length) * (1.0 - ahead)
        return 1.0, min(self.margin, _MAX_MARGIN), ahead, ahead * self.lead / _LEAD_SCALE, begun


WEIGHTS: Mapping[RiskReason, tuple[float, float, float, float, float]] = {
    "id_switch": (-0.50, -0.84, 0.00, 0.00, 0.26),
    "crossing": (-2.40, -0.02, 0.45, -0.08, 0.48),
    "track_loss": (-4.71, -0.02, -0.05, -0.12, 1.23),
    "optimality_gap": (-3.00, -1.00, 0.00, 0.00, 0.00),
}
"""By reason; learned by `python -m benchmarks.operator_assist.risk_weights`, except for `optimality_gap`, of
which there are no examples since the default solver proves optimality. Its weights are a guess: at most one
in twenty, decreasing with the margin."""


def failure_probability(reason: RiskReason, features: RiskFeatures) -> float:
    """Return the probability of an identity failure, by logistic regression."""
    odds = sum(weight * term for weight, term in zip(WEIGHTS[reason], features.regression_terms, strict=True))
    return 1.0 / (1.0 + math.exp(-odds))


class RiskPredictor:
    """Predicts identity failures from solved windows. Stateless."""

    def __init__(self, settings: ResolvedInteractiveSettings, costs: CostSettings) -> None:
        self._settings = settings
        self._costs = costs

    def predict(self, window: SolvedWindow) -> tuple[RiskEvent, ...]:
        """Return the risk events of a window, the riskiest first, one per pair and reason."""
        found = find_cheapest_swaps(window.network, window.states)
        events = [
            *self._swaps(window, found),
            *self._similar_crossings(window),
            *self._occluded_objects(window),
            *self._low_confidence(window),
            *self._unproven(window, found.margins),
        ]
        unique: dict[tuple[str, tuple[int, ...]], RiskEvent] = {}
        for event in sorted(events, key=lambda it: (-it.risk, it.frame, it.objects, it.reason)):
            unique.setdefault((event.reason, tuple(sorted(event.objects))), event)
        return tuple(unique.values())

    def _swaps(self, window: SolvedWindow, found: CheapestSwaps) -> list[RiskEvent]:
        """Return the pairs with a small swap margin in a frame that becomes final with this window."""
        settled = window.first + found.frames <= window.final_to
        first, second = np.nonzero(np.triu((found.margins < self._settings.swap_margin) & settled, 1))
        return [
            _risk_event(
                "id_switch",
                _pair(window, a, b),
                window,
                window.first + int(found.frames[a, b]),
                float(found.margins[a, b]),
                _ambiguous_frames(window, a, b),
            )
            for a, b in zip(first.tolist(), second.tolist(), strict=True)
        ]

    def _similar_crossings(self, window: SolvedWindow) -> list[RiskEvent]:
        """Return the pairs that cross within the horizon and could then be swapped at low cost."""
        found = predict_crossings(window, self._settings.horizon_frames, self._costs)
        return [
            _risk_event(
                "crossing",
                tuple(sorted((crossing.first, crossing.second))),
                window,
                window.last + 1 + crossing.offset,
                crossing.margin,
                crossing.length,
            )
            for crossing in found
            if crossing.margin < self._settings.crossing_margin
        ]

    def _occluded_objects(self, window: SolvedWindow) -> list[RiskEvent]:
        """Return the objects occluded for some time, with the similar object that occludes them, if any.

        The margin is the appearance distance of the two over a whole window, minus the distance of an object
        to itself; it is 0 for an object without an occluder.
        """
        histograms, found = window.known_histograms, []
        length = window.last - window.first + 1
        for n, (occluded, path) in predict_paths(window, window.recent_boxes.shape[1]).items():
            if occluded < self._settings.hidden_frames:
                continue
            others = window.recent_boxes[:, -occluded:].copy()
            others[n] = np.nan
            overlaps = np.nan_to_num(dice_overlap(others, path[:occluded])).max(axis=1, initial=0.0)
            b = int(overlaps.argmax())
            frame = window.last - occluded + 1
            distance = float(
                appearance_distance_matrix(histograms[n, None], histograms[b, None], self._costs.measure)[
                    0, 0
                ]
            )
            margin = length * max(distance - self._costs.unknown_appearance, 0.0)
            if overlaps[b] > _MIN_OVERLAP and margin < self._settings.crossing_margin:
                pair = window.known_ids[n], window.known_ids[b]
                found.append(_risk_event("crossing", pair, window, frame, margin, occluded))
            else:
                found.append(_risk_event("track_loss", (window.known_ids[n],), window, frame, 0.0, occluded))
        return found

    def _low_confidence(self, window: SolvedWindow) -> list[RiskEvent]:
        """Return the objects whose detection scores are low, or will be within the horizon."""
        found = []
        scores, threshold = window.track_scores, self._settings.min_confidence
        for n, number in enumerate(window.ids):
            visible = np.flatnonzero(~np.isnan(scores[n]))
            if len(visible) < 2 * _RECENT or visible[-1] < scores.shape[1] - _RECENT:
                continue
            slope, level = np.polyfit(visible - visible[-1], scores[n, visible], 1)
            frames_left = (level - threshold) / -slope if slope < 0.0 else np.inf
            if level <= threshold or frames_left <= self._settings.horizon_frames:
                frame = window.last + max(int(frames_left), 0) if level > threshold else window.last
                found.append(_risk_event("track_loss", (number,), window, frame, float(level - threshold), 0))
        return found

    def _unproven(self, window: SolvedWindow, margins: Floats) -> list[RiskEvent]:
        """Return the pair with the smallest swap margin, if the solution is not proven optimal."""
        if window.report.gap <= self._settings.max_solver_gap or not np.isfinite(margins).any():
            return []
        a, b = divmod(int(margins.argmin()), margins.shape[1])
        pair = _pair(window, a, b)
        return [
            _risk_event(
                "optimality_gap",
                pair,
                window,
                window.last,
                float(margins[a, b]),
                _ambiguous_frames(window, a, b),
            )
        ]


def _risk_event(
    reason: RiskReason, objects: tuple[int, ...], window: SolvedWindow, frame: int, margin: float, length: int
) -> RiskEvent:
    """Return a risk event with its probability; `length` as in `RiskFeatures`."""
    margin = max(margin, 0.0)
    probability = failure_probability(reason, RiskFeatures(margin, frame - window.last, length))
    return RiskEvent(reason, objects, frame, margin, length, probability)


def _ambiguous_frames(window: SolvedWindow, a: int, b: int) -> int:
    """Return in how many recent frames objects a and b overlapped, or one of them was occluded."""
    first, second = (window.recent_boxes[window.known_ids.index(window.ids[n])] for n in (a, b))
    occluded = np.isnan(first[:, 0]) | np.isnan(second[:, 0])
    return int(np.count_nonzero(occluded | (np.nan_to_num(dice_overlap(first, second)) > _MIN_OVERLAP)))


def _pair(window: SolvedWindow, a: int, b: int) -> tuple[int, ...]:
    return tuple(sorted((window.ids[a], window.ids[b])))
