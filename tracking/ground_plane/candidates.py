"""Candidates: people who may have arrived, and the evidence for them before the window.

Whom a single camera sees is hardly ever certain within one window. A candidate collects the log likelihood
ratio of being a person frame by frame, and is dropped when it falls to zero, where a new one would begin
(a CUSUM test: Page, Continuous inspection schemes, 1954). An arrival that continues a candidate costs less by
what it has collected: the program then decides as if its window had begun earlier.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.assignment import assign_pairs
from tracking.boxes import Floats
from tracking.ground_plane.gaussians import OffsetDensities, squared_distances
from tracking.ground_plane.motion import is_possible
from tracking.ground_plane.places.hypotheses import Places
from tracking.ground_plane.settings import GroundSettings

_GATE = 9.2
"""Squared Mahalanobis distance, the quantile .99, within which a candidate is the person found there."""
_MAX_UNSEEN_S = 1.0
"""Seconds unseen after which a candidate is dropped."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """Somebody who may be there.

    Attributes:
        place: (2,) where they were seen last, meters.
        covariance: (2, 2) of the place, m².
        unseen: seconds since.
        evidence: log likelihood ratio of being a person to being false detections, above 0.
    """

    place: Floats
    covariance: Floats
    unseen: float
    evidence: float


class Candidates:
    """The candidates after the last final frame; frames are `seconds` apart."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._candidates: list[Candidate] = []

    @property
    def places(self) -> Floats:
        """Where they were seen last, (N, 2)."""
        return np.array([candidate.place for candidate in self._candidates]).reshape(-1, 2)

    def discounts(self, places: Places, settings: GroundSettings) -> Floats:
        """Return by how much less an arrival costs at each of K places of the next frame, (K,)."""
        if not self._candidates or not len(places):
            return np.zeros(len(places))
        return np.asarray(np.maximum(self._continued(places, range(len(places)), settings).max(axis=0), 0.0))

    def update(self, places: Places, chosen: Sequence[int], missed: Floats, settings: GroundSettings) -> None:
        """Add a final frame, in which people were found at the `chosen` places.

        `missed`: (N,) costs of each candidate being seen by no camera in this frame.
        """
        free = _free_places(places, chosen)
        found = self._found(places, chosen, settings)
        begun = -places.arrival_costs[free]
        continued = self._continued(places, free, settings) + begun
        continued[sorted(found)] = -np.inf
        rows, columns = assign_pairs(continued, 0.0)
        evidence, kept = begun.copy(), list[Candidate]()
        evidence[columns] = np.maximum(begun[columns], continued[rows, columns])
        for n in sorted(set(range(len(self._candidates))) - set(rows.tolist()) - found):
            old = self._candidates[n]
            kept.append(
                Candidate(
                    old.place,
                    old.covariance,
                    old.unseen + self._seconds,
                    old.evidence - float(missed[n]),
                )
            )
        kept += [
            Candidate(places.means[k], places.covariances[k], 0.0, float(evidence[at]))
            for at, k in enumerate(free)
        ]
        self._candidates = [each for each in kept if each.evidence > 0.0 and each.unseen <= _MAX_UNSEEN_S]

    def clear(self) -> None:
        """Forget all."""
        self._candidates = []

    def _continued(self, places: Places, indices: Sequence[int], settings: GroundSettings) -> Floats:
        """Return the evidence of each candidate before it moved to each of these places, (N, K).

        It is -inf where a place is too far.
        """
        if not self._candidates or not len(indices):
            return np.zeros((len(self._candidates), len(indices)))
        chosen = list(indices)
        offsets = places.means[None, chosen] - self.places[:, None]
        moves = OffsetDensities.of(
            offsets, places.covariances[None, chosen] + self._spreads(settings)[:, None]
        )
        evidence = np.array([candidate.evidence for candidate in self._candidates])[:, None]
        costs = moves.correlated(settings.detection_weight(self._seconds))
        return np.where(is_possible(moves), evidence - costs, -np.inf)

    def _spreads(self, settings: GroundSettings) -> Floats:
        """Return the covariances of where they may be in the next frame, (N, 2, 2)."""
        walked = [
            (settings.speed * (candidate.unseen + self._seconds)) ** 2 for candidate in self._candidates
        ]
        covariances = np.array([candidate.covariance for candidate in self._candidates])
        return np.asarray(covariances + np.array(walked)[:, None, None] * np.eye(2))

    def _found(self, places: Places, chosen: Sequence[int], settings: GroundSettings) -> set[int]:
        """Return the candidates who are among the people found."""
        if not self._candidates or not len(chosen):
            return set()
        people = list(chosen)
        offsets = places.means[None, people] - self.places[:, None]
        distances = squared_distances(
            offsets, places.covariances[None, people] + self._spreads(settings)[:, None]
        )
        return set(np.flatnonzero((distances < _GATE).any(axis=1)).tolist())


def _free_places(places: Places, chosen: Sequence[int]) -> list[int]:
    """Return the likeliest places that exclude neither each other nor the chosen ones."""
    taken, free = list(chosen), list[int]()
    for k in np.argsort(places.costs, kind="stable").tolist():
        if places.arrival_costs[k] < 0.0 and not places.conflicts[k, taken].any():
            taken.append(k)
            free.append(k)
    return free
