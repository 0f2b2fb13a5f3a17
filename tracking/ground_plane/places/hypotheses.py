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

from tracking.boxes import Floats
from tracking.ground_plane.camera import BoxSizes, GroundCamera
from tracking.ground_plane.gaussians import (
    LOG_2PI,
    determinants,
    fuse,
    negative_log_densities,
    squared_distances,
)
from tracking.ground_plane.places.measurements import Measurements
from tracking.ground_plane.places.misplaced_feet import find_misplaced
from tracking.ground_plane.places.visibility import detection_probabilities
from tracking.ground_plane.settings import GroundSettings

_MIN_MERGE_GAIN = -4.0
"""Log likelihood ratio below which two groups are certainly of two people."""
_CERTAIN_MERGE_GAIN = 2.0
"""Above it they are of one person, so that neither is a hypothesis alone."""
_PREDICTION_GATE, _GROUP_GATE = 11.0, 9.2
"""Squared Mahalanobis distances, quantiles .996 and .99 of two degrees of freedom."""
_CLEAR_LOG_ODDS = -1.4
"""Log odds (a probability of .2) from which a detection may be somebody who is not known yet.

Furniture that looks a little like a person does so forever: what little each frame says must not add up.
"""
_MAX_COST = 8.0
"""Hypotheses that cost more are never chosen."""


@dataclass(frozen=True, eq=False)
class Places:
    """The K hypotheses of a frame.

    Attributes:
        measurements: the frame's detections.
        groups: indices of the detections of each place, ascending.
        means: (K, 2) metres.
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
    def arrival_costs(self) -> Floats:
        """The costs for somebody who is not known yet, (K,): places that nobody sees clearly gain nothing."""
        odds = self.measurements.log_odds
        is_clear = np.array(
            [(odds[list(group)] >= _CLEAR_LOG_ODDS).any() for group in self.groups], dtype=np.bool_
        )
        return np.where(is_clear, self.costs, np.maximum(self.costs, 0.0))

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
    fused = [fuse(measurements.places[[*group]], measurements.covariances[[*group]]) for group in groups]
    means = np.array([mean for mean, _ in fused]).reshape(-1, 2)
    covariances = np.array([covariance for _, covariance in fused]).reshape(-1, 2, 2)
    costs = np.array(
        [
            group_cost(measurements, group, mean, covariance, settings.detection_probability)
            for group, (mean, covariance) in zip(groups, fused, strict=True)
        ]
    )
    members = np.zeros((len(groups), len(measurements)), dtype=np.bool_)
    for k, group in enumerate(groups):
        members[k, list(group)] = True
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
    shared = members[kept].astype(np.float64)
    return Places(
        measurements,
        tuple(groups[k] for k in kept),
        means[kept],
        covariances[kept],
        costs[kept],
        np.asarray(shared @ shared.T > 0.0),
        misplaced[kept],
    )


def group_cost(
    measurements: Measurements,
    group: tuple[int, ...],
    mean: Floats,
    covariance: Floats,
    probability: float,
) -> float:
    """Return the cost of the detections of a group alone, without the cameras that miss the person."""
    chosen = list(group)
    offsets = measurements.places[chosen] - mean
    consistency = negative_log_densities(offsets, measurements.covariances[chosen]).sum()
    # The integral of the product of the densities over the place.
    consistency -= 0.5 * np.log(determinants(covariance)) + LOG_2PI
    return float(consistency + measurements.log_clutter[chosen].sum() - len(chosen) * np.log(probability))


def agglomerate(measurements: Measurements, density: float) -> list[tuple[int, ...]]:
    """Merge the likeliest pair of groups until none is likely; return all groups that are in doubt.

    The gain of a merge is the log likelihood ratio of one person to two, who are somewhere among `density`
    people per m².
    """
    count = len(measurements)
    size = 2 * count
    groups: list[tuple[int, ...]] = [(k,) for k in range(count)]
    means, covariances = np.zeros((size, 2)), np.tile(np.eye(2), (size, 1, 1))
    means[:count], covariances[:count] = measurements.places, measurements.covariances
    seen_by = np.zeros((size, int(measurements.camera.max(initial=0)) + 1), dtype=np.bool_)
    seen_by[np.arange(count), measurements.camera] = True
    open_groups, certain = np.zeros(size, dtype=np.bool_), set[int]()
    gains = np.full((size, size), -np.inf)

    def add(index: int) -> None:
        others = np.flatnonzero(open_groups)
        offsets = means[others] - means[index]
        found = -negative_log_densities(offsets, covariances[others] + covariances[index]) - np.log(density)
        gains[index, others] = np.where((seen_by[others] & seen_by[index]).any(axis=1), -np.inf, found)
        open_groups[index] = True

    for index in range(count):
        add(index)
    while len(groups) < size:
        known = gains[: len(groups), : len(groups)]
        first, second = divmod(int(known.argmax()), len(groups))
        if known[first, second] < _MIN_MERGE_GAIN:
            break
        if known[first, second] > _CERTAIN_MERGE_GAIN:
            certain.update((first, second))
        pair, merged = [first, second], len(groups)
        groups.append(tuple(sorted(groups[first] + groups[second])))
        means[merged], covariances[merged] = fuse(means[pair], covariances[pair])
        seen_by[merged] = seen_by[pair].any(axis=0)
        open_groups[pair] = False
        gains[pair, :] = gains[:, pair] = -np.inf
        add(merged)
    return [group for index, group in enumerate(groups) if index not in certain]


def _group_near(measurements: Measurements, mean: Floats, covariance: Floats) -> tuple[int, ...]:
    """Return the detections, the likeliest of each camera, that fit a predicted place and each other."""
    spread = measurements.covariances + covariance
    distances = squared_distances(measurements.places - mean, spread)
    costs = distances + np.log(determinants(spread)) + 2.0 * measurements.log_clutter
    group = []
    for camera in np.unique(measurements.camera):
        near = np.flatnonzero((measurements.camera == camera) & (distances < _PREDICTION_GATE))
        if len(near):
            group.append(int(near[costs[near].argmin()]))
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
