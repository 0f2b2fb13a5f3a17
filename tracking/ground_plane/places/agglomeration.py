"""Detections of several cameras merged into groups, the likeliest pair first."""

from __future__ import annotations

from heapq import heapify, heappop, heappush

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.ground_plane.gaussians import LOG_2PI, fuse_two
from tracking.ground_plane.places.measurements import Measurements

_MIN_MERGE_GAIN = -4.0
"""Log likelihood ratio below which two groups are certainly of two people."""
_CERTAIN_MERGE_GAIN = 2.0
"""Above it they are of one person, so that neither is a hypothesis alone."""


def agglomerate(measurements: Measurements, density: float) -> list[tuple[int, ...]]:
    """Merge the likeliest pair of groups until none is likely; return all groups that are in doubt.

    The gain of a merge is the log likelihood ratio of one person to two, who are somewhere among `density`
    people per m². The likely merges wait in a heap.
    """
    groups: list[tuple[int, ...]] = [(k,) for k in range(len(measurements))]
    seen_by = [1 << camera for camera in measurements.camera.tolist()]
    certain = set[int]()
    open_groups = _OpenGroups(measurements, density)
    merges = open_groups.likely_pairs(measurements.camera)
    heapify(merges)
    while merges:
        loss, first, second = heappop(merges)
        if first not in open_groups or second not in open_groups:
            continue
        if -loss > _CERTAIN_MERGE_GAIN:
            certain.update((first, second))
        merged = len(groups)
        groups.append(tuple(sorted(groups[first] + groups[second])))
        seen_by.append(seen_by[first] | seen_by[second])
        place = fuse_two(open_groups.remove(first), open_groups.remove(second))
        for other, gain in open_groups.likely_merges(*place):
            if not seen_by[other] & seen_by[merged]:
                heappush(merges, (-gain, merged, other))
        open_groups.add(merged, *place)
    return [group for index, group in enumerate(groups) if index not in certain]


class _OpenGroups:
    """Places of the groups that are not merged yet: the first rows of arrays, the last fills every gap."""

    def __init__(self, measurements: Measurements, density: float) -> None:
        self._means = measurements.places.T.copy()
        self._covariances = np.moveaxis(measurements.covariances, 0, 2).copy()
        self._groups = list(range(len(measurements)))
        self._rows = dict(enumerate(range(len(measurements))))
        self._least = _MIN_MERGE_GAIN
        self._constant = -LOG_2PI - float(np.log(density))

    def __contains__(self, group: int) -> bool:
        return group in self._rows

    def add(self, group: int, mean: Floats, covariance: Floats) -> None:
        """Add a group."""
        row = self._rows[group] = len(self._groups)
        self._groups.append(group)
        self._means[:, row], self._covariances[:, :, row] = mean, covariance

    def remove(self, group: int) -> tuple[Floats, Floats]:
        """Remove a group; return mean and covariance of its place."""
        row, last = self._rows.pop(group), self._groups.pop()
        found = self._means[:, row].copy(), self._covariances[:, :, row].copy()
        if last != group:
            end = len(self._groups)
            self._groups[row], self._rows[last] = last, row
            self._means[:, row] = self._means[:, end]
            self._covariances[:, :, row] = self._covariances[:, :, end]
        return found

    def likely_pairs(self, camera: NDArray[np.int64]) -> list[tuple[float, int, int]]:
        """Return the likely merges of detections by different cameras, (N,): losses, and the two groups."""
        pairs: list[tuple[float, int, int]] = []
        for first in np.unique(camera)[1:].tolist():
            own, others = np.flatnonzero(camera == first), np.flatnonzero(camera < first)
            x, y = self._means[:, own, None] - self._means[:, None, others]
            gains = self._gains(
                x, y, self._covariances[:, :, own, None] + self._covariances[:, :, None, others]
            )
            one, two = np.nonzero(gains >= self._least)
            pairs += zip((-gains[one, two]).tolist(), own[one].tolist(), others[two].tolist(), strict=True)
        return pairs

    def likely_merges(self, mean: Floats, covariance: Floats) -> list[tuple[int, float]]:
        """Return the groups that a group with this place may be merged with, and the gains."""
        count = len(self._groups)
        x, y = self._means[:, :count] - mean[:, None]
        gains = self._gains(x, y, self._covariances[:, :, :count] + covariance[:, :, None])
        return [(self._groups[row], float(gains[row])) for row in np.flatnonzero(gains >= self._least)]

    def _gains(self, x: Floats, y: Floats, covariances: Floats) -> Floats:
        """Return the gains of merging groups at offsets (...), with covariances (2, 2, ...) of these."""
        (xx, xy), (yx, yy) = covariances
        # As in `negative_log_densities`, with one axis only: this is called for every group.
        determinants = xx * yy - xy * yx
        distances = (yy * x * x - (xy + yx) * x * y + xx * y * y) / determinants
        return np.asarray(self._constant - 0.5 * (distances + np.log(determinants)))
