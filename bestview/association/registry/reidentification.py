"""Re-identification: clusters without an id are matched with lost people by appearance and travel time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy
from numpy.typing import NDArray

from bestview.association.affinity.affinity_matrix import AffinityMatrix
from bestview.association.affinity.travel_times import CameraSighting, TravelTimeModel
from bestview.association.appearance.cross_camera import CrossCameraAppearance
from bestview.association.appearance.histograms import (
    CDF_POINTS,
    HistogramEqualizer,
    PersonAppearance,
    cdf_distance,
)
from bestview.association.registry.other_sites import ReferenceHistograms
from bestview.association.registry.person import Person
from bestview.association.settings import ResolvedIdentitySettings
from bestview.association.tracklet_clusters import TrackletCluster

Floats = NDArray[np.float64]
_AMBIGUITY_RATIO = 1.5
"""How many times further the second best must be before appearance alone decides."""
_FORBIDDEN_COST = 1e6
_CLOCKS_S = 1.0
"""Seconds by which the time of another site's sighting may be wrong."""


@dataclass(frozen=True, slots=True, eq=False)
class LostPerson:
    """A person that no camera sees.

    Attributes:
        person: with their settled appearance.
        cluster: their cluster; None: they take part in no clustering.
    """

    person: Person
    cluster: TrackletCluster | None

    @property
    def appearance(self) -> PersonAppearance:
        """Their appearance, including tracklets that are not settled yet."""
        return self.person.appearance if self.cluster is None else self.cluster.appearance


class Reidentifier:
    """Matches new clusters with lost people by appearance and travel time.

    Args:
        settings: of identity.
        cameras: how many there are.
    """

    def __init__(self, settings: ResolvedIdentitySettings, cameras: int) -> None:
        self._settings = settings
        self._travel = TravelTimeModel(settings, cameras)
        self._covisible_cameras: set[tuple[str, str]] = set()
        """Pairs of cameras that have seen one person at the same time."""
        self.reference_histograms = ReferenceHistograms()

    def learn_covisible_cameras(self, clusters: Iterable[TrackletCluster], frame: int) -> None:
        """Learn from clusters which cameras see the same people simultaneously: their views overlap."""
        since = frame - self._settings.clustering_interval
        for cluster in clusters:
            cameras = {tracklet.key.camera for tracklet in cluster.tracklets if tracklet.end.frame >= since}
            self._covisible_cameras.update(combinations(sorted(cameras), 2))

    def match(
        self,
        new: Sequence[TrackletCluster],
        lost: Sequence[LostPerson],
        affinity: AffinityMatrix,
        cross_camera: CrossCameraAppearance,
        frame: int,
    ) -> list[int]:
        """Return for each new cluster the index of the lost person that it matches, or -1."""
        allowed = [
            self._may_match(cluster, lost_person, affinity, cross_camera, frame)
            for cluster in new
            for lost_person in lost
        ]
        possible = np.array(allowed, dtype=np.bool_).reshape(len(new), len(lost))
        if not possible.any():
            return [-1] * len(new)
        appearances = (
            [cluster.appearance for cluster in new],
            [lost_person.appearance for lost_person in lost],
        )
        arrivals, departures = (
            [_first_sighting(cluster) for cluster in new],
            [lost_person.person.last_sighting for lost_person in lost],
        )
        time = self._travel.evidence(arrivals, departures)
        distances = appearance_distances(cross_camera.equalizer, *appearances)
        site_histograms = [lost_person.person.site_histograms for lost_person in lost]
        between_sites = self.reference_histograms.distances(
            cross_camera.equalizer, appearances[0], site_histograms
        )
        distances = np.where(np.isnan(distances), between_sites, distances)
        gate = cross_camera.same_person_gate
        by_appearance = match_by_appearance(distances, possible, gate)
        distance_factor = np.exp(-time / self._settings.travel_appearance_weight)
        matches = match_by_appearance(distances * distance_factor, possible, gate)
        for i, match in enumerate(by_appearance):
            if match < 0:
                continue
            # Travel times are learned from matches by appearance alone: otherwise they would confirm
            # themselves.
            self._travel.learn(departures[match], arrivals[i])
            if (
                matches[i] < 0
                and match not in matches
                and time[i, match] > -self._settings.maximum_travel_evidence / 2.0
            ):
                matches[i] = match
        return matches

    def _may_match(
        self,
        new: TrackletCluster,
        lost: LostPerson,
        affinity: AffinityMatrix,
        cross_camera: CrossCameraAppearance,
        frame: int,
    ) -> bool:
        """Return whether a new cluster may be matched with a lost person by appearance and travel time."""
        known_cluster = lost.cluster
        if lost.person.elsewhere and known_cluster is None:
            # Nobody is here before they have left the other site; its frames are known less exactly.
            margin = _CLOCKS_S * self._settings.fps
            return _first_sighting(new).frame > lost.person.last_frame - margin
        if known_cluster is None:
            # A person who took part in clustering and has no cluster is in that of another id.
            return lost.person.last_frame < frame - self._settings.comparable_frames
        # Pairs that can be compared directly were decided by the clustering.
        compared = bool(new.cameras_so_far & known_cluster.cameras_so_far) or (
            cross_camera.share_ground(new.cameras_so_far, known_cluster.cameras_so_far)
            and self._share_view(new, known_cluster)
        )
        return not compared and not affinity.any_cannot_link(new.rows, known_cluster.rows)

    def _share_view(self, first: TrackletCluster, second: TrackletCluster) -> bool:
        pairs = {(min(a, b), max(a, b)) for a in first.cameras_so_far for b in second.cameras_so_far}
        return not pairs.isdisjoint(self._covisible_cameras)


def _first_sighting(new: TrackletCluster) -> CameraSighting:
    """Return the camera and frame in which a cluster was seen first."""
    frame, camera = min((tracklet.start.frame, tracklet.key.camera) for tracklet in new.tracklets)
    return CameraSighting(camera, frame)


def match_by_appearance(distances: Floats, possible: NDArray[np.bool_], gate: float) -> list[int]:
    """Match new people with lost people by appearance, in one linear assignment.

    A match counts only if no other candidate is nearly as similar: a wrong id is worse than a new one.

    Args:
        distances: (N, L) of new from lost people, other evidence included; NaN: unknown.
        possible: (N, L); False: certainly not one person.
        gate: distance below which two appearances are likely of one person.

    Returns:
        For each new person the index of the lost one, or -1.
    """
    matches = [-1] * len(distances)
    if not distances.size:
        return matches
    distance = np.where(possible, distances, np.nan)
    acceptable = unambiguous_minima(distance, _AMBIGUITY_RATIO) & (distance <= gate)
    row, column = scipy.optimize.linear_sum_assignment(np.where(acceptable, distance, _FORBIDDEN_COST))
    for i, j in zip(row.tolist(), column.tolist(), strict=True):
        if acceptable[i, j]:
            matches[i] = j
    return matches


def unambiguous_minima(cost: Floats, ratio: float) -> NDArray[np.bool_]:
    """Return where an entry is the least of its row and column, and the next is `ratio` times as large.

    NaN and infinite entries do not compete.
    """
    filled = np.where(np.isnan(cost), np.inf, cost)
    unambiguous = np.isfinite(filled)
    for axis in (0, 1):
        if cost.shape[axis] > 1:
            two = np.sort(filled, axis=axis)
            least, second = np.take(two, [0], axis=axis), np.take(two, [1], axis=axis)
            unambiguous &= (filled == least) & (second >= ratio * least)
    return unambiguous


@dataclass(frozen=True, slots=True)
class _EqualizedCurves:
    """Equalized histograms of P people, L in all, sorted by person and camera.

    Attributes:
        owner: (L,) which of the people.
        camera: (L,) names.
        bins: (L,) of the histogram; only equal numbers can be compared.
        curves: (L, 33) equalized cumulative histograms.
    """

    owner: NDArray[np.int64]
    camera: NDArray[np.str_]
    bins: NDArray[np.int64]
    curves: Floats

    @classmethod
    def of(cls, equalizer: HistogramEqualizer, people: Sequence[PersonAppearance]) -> _EqualizedCurves:
        entries = [
            (i, c, histogram)
            for i, appearance in enumerate(people)
            for c, histogram in sorted(appearance.by_camera.items())
        ]
        rows_by_kind: dict[tuple[str, int], list[int]] = {}
        for row, (_, camera, histogram) in enumerate(entries):
            rows_by_kind.setdefault((camera, histogram.histogram_sum.size), []).append(row)
        curves = np.zeros((len(entries), CDF_POINTS))
        for (camera, _), rows in rows_by_kind.items():
            curves[rows] = equalizer.equalize(camera, np.array([entries[row][2].mean for row in rows]))
        return cls(
            owner=np.array([i for i, _, _ in entries], dtype=np.int64),
            camera=np.array([camera for _, camera, _ in entries], dtype=np.str_),
            bins=np.array([histogram.histogram_sum.size for _, _, histogram in entries], dtype=np.int64),
            curves=curves,
        )


def appearance_distances(
    equalizer: HistogramEqualizer, new: Sequence[PersonAppearance], old: Sequence[PersonAppearance]
) -> Floats:
    """Compute (N, L) appearance distances, in common cameras where there are any; NaN: unknown."""
    new_curves, old_curves = _EqualizedCurves.of(equalizer, new), _EqualizedCurves.of(equalizer, old)
    # Sums by pair of people and their numbers of histograms: in common cameras, and in any.
    total, count, common = (np.zeros((2, len(new), len(old))) for _ in range(3))
    for owner, camera, bins, curve in zip(
        new_curves.owner, new_curves.camera, new_curves.bins, new_curves.curves, strict=True
    ):
        distance = cdf_distance(curve, old_curves.curves)
        for kind, comparable in enumerate(
            (old_curves.camera == camera, np.ones(old_curves.owner.size, dtype=np.bool_))
        ):
            fits = comparable & (old_curves.bins == bins)
            total[kind, owner] += np.bincount(old_curves.owner[fits], distance[fits], minlength=len(old))
            count[kind, owner] += np.bincount(old_curves.owner[fits], minlength=len(old))
            common[kind, owner] += np.bincount(old_curves.owner[comparable], minlength=len(old))
    mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
    return np.asarray(np.where(common[0] > 0, mean[0], mean[1]))
