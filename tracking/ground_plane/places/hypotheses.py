"""Hypotheses of one frame: groups of detections, at most one per camera, that may be of one person.

Groups are alternatives: those that share a detection exclude each other, and the network program chooses. A
group with detections whose feet are wrong (`misplaced_feet`) is another one beside that without them.
The cost of a place is the negative log likelihood ratio of its detections being of one person to all of them
being false; it integrates over the unknown place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from tracking.boxes import Floats
from tracking.ground_plane.camera import BoxSizes, GroundCamera
from tracking.ground_plane.gaussians import FusedPlaces, determinants, fuse, squared_distances
from tracking.ground_plane.places.agglomeration import agglomerate
from tracking.ground_plane.places.measurements import Measurements
from tracking.ground_plane.places.misplaced_feet import find_misplaced
from tracking.ground_plane.places.visibility import detection_probabilities
from tracking.ground_plane.settings import GroundSettings

_PREDICTION_GATE, _GROUP_GATE = 11.0, 9.2
"""Squared Mahalanobis distances, quantiles .996 and .99 of two degrees of freedom."""
_CLEAR_LOG_ODDS = -1.4
"""Log odds (a probability of .2) from which a detection may be somebody who is not known yet.

Furniture that looks a little like a person does so forever: what little each frame says must not add up. Nor
must it keep somebody there who was taken for a person once.
"""
_MAX_COST = 8.0
"""Hypotheses that cost more are never chosen."""


@dataclass(frozen=True, eq=False)
class Places:
    """The K hypotheses of a frame.

    Attributes:
        measurements: the frame's detections.
        groups: indices of the detections of each place, ascending.
        means: (K, 2) meters.
        covariances: (K, 2, 2) m².
        costs: (K,) of the place being a person, against its detections being false.
        conflicts: (K, K) bool, places that share a detection.
        misplaced: (K, D) bool, the detections of a place whose feet are wrong.
    """

    measurements: Measurements
    groups: tuple[tuple[int, ...], ...]
    means: Floats
    covariances: Floats
    costs: Floats
    conflicts: NDArray[np.bool_]
    misplaced: NDArray[np.bool_]

    def locating(self, k: int) -> list[int]:
        """Return the detections that locate place `k`: those with their feet on it."""
        return [d for d in self.groups[k] if not self.misplaced[k, d]]

    @cached_property
    def misplacements(self) -> Floats:
        """Covariances of the places' errors if the feet are wrong, (K, 2, 2) m²; 0 where cameras agree."""
        found = np.zeros((len(self), 2, 2))
        for k in range(len(self)):
            locating = self.locating(k)
            if len(locating) == 1:
                found[k] = self.measurements.misplacements[locating[0]]
        return found

    @cached_property
    def is_clear(self) -> NDArray[np.bool_]:
        """Whether a detection of each place is not unlikely, (K,)."""
        odds = self.measurements.log_odds
        return np.array(
            [(odds[list(group)] >= _CLEAR_LOG_ODDS).any() for group in self.groups], dtype=np.bool_
        )

    @cached_property
    def arrival_costs(self) -> Floats:
        """The costs for somebody who is not known yet, (K,): places that nobody sees clearly gain nothing."""
        return np.where(self.is_clear, self.costs, np.maximum(self.costs, 0.0))

    def __len__(self) -> int:
        return len(self.groups)


def find_places(
    measurements: Measurements,
    predictions: Sequence[tuple[Floats, Floats]],
    cameras: Sequence[GroundCamera],
    sizes: Sequence[BoxSizes],
    settings: GroundSettings,
    seconds: float,
) -> Places:
    """Return the hypotheses of a frame.

    `predictions`: means (2,) and covariances (2, 2) of the places of people known before. `seconds` from one
    frame to the next: frames that follow each other closely err alike, so that each says less.
    """
    candidates = dict.fromkeys(agglomerate(measurements, settings.people_density))
    for mean, covariance in predictions:
        group = _group_near(measurements, mean, covariance)
        if group:
            candidates[group] = None
    groups = list(candidates)
    fused = FusedPlaces.of(measurements.places, measurements.covariances, groups)
    means, covariances = fused.means, fused.covariances
    members = np.zeros((len(groups), len(measurements)), dtype=np.bool_)
    for k, group in enumerate(groups):
        members[k, list(group)] = True
    costs = group_costs(measurements, members, fused, settings.detection_probability)
    probabilities = detection_probabilities(
        means, cameras, sizes, measurements, members, settings.detection_probability
    )
    for k, group in enumerate(groups):
        probabilities[k, measurements.camera[list(group)]] = 0.0
    misses = -np.log1p(-probabilities)
    costs += misses.sum(axis=1)
    more = find_misplaced(measurements, members, means, misses, cameras, sizes, settings)
    extended = np.flatnonzero(more.costs < 0.0)
    groups += [tuple(np.flatnonzero(members[k] | more.members[k]).tolist()) for k in extended]
    means, covariances = (np.concatenate([each, each[extended]]) for each in (means, covariances))
    costs = np.concatenate([costs, (costs + more.costs)[extended]])
    misplaced = np.concatenate([np.zeros_like(members), more.members[extended]])
    members = np.concatenate([members, (members | more.members)[extended]])
    costs *= settings.detection_weight(seconds)
    kept = np.flatnonzero(costs < _MAX_COST)
    sharing = csr_array(members[kept], dtype=np.int32)
    shared = csr_array(sharing @ sharing.T)
    return Places(
        measurements,
        tuple(groups[k] for k in kept),
        means[kept],
        covariances[kept],
        costs[kept],
        np.asarray(shared.toarray() > 0),
        misplaced[kept],
    )


def group_costs(
    measurements: Measurements, members: NDArray[np.bool_], fused: FusedPlaces, probability: float
) -> Floats:
    """Return the costs of the detections of groups alone, without the cameras that miss the person, (G,).

    `members` (G, D): the detections of each group.
    """
    clutter = members @ measurements.log_clutter
    return np.asarray(fused.costs + clutter - members.sum(axis=1) * np.log(probability))


def _group_near(measurements: Measurements, mean: Floats, covariance: Floats) -> tuple[int, ...]:
    """Return the detections, the likeliest of each camera, that fit a predicted place and each other."""
    spread = measurements.covariances + covariance
    distances = squared_distances(measurements.places - mean, spread)
    near = np.flatnonzero(distances < _PREDICTION_GATE)
    costs = distances[near] + np.log(determinants(spread[near])) + 2.0 * measurements.log_clutter[near]
    # The cheapest of each camera, whose detections follow each other.
    order = near[np.lexsort((costs, measurements.camera[near]))]
    cameras = measurements.camera[order]
    group = order[np.diff(cameras, prepend=-1) > 0].tolist()
    for _ in range(2):
        if not group:
            break
        place, _ = fuse(
            np.concatenate([measurements.places[group], mean[None]]),
            np.concatenate([measurements.covariances[group], covariance[None]]),
        )
        fits = (
            squared_distances(measurements.places[group] - place, measurements.covariances[group])
            < _GROUP_GATE
        )
        group = [k for k, near in zip(group, fits, strict=True) if near]
    return tuple(sorted(group))
