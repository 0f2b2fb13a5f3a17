"""Which tracks of an update were seen simultaneously, and how close they stood on the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.association.index_ranges import expand_counts, pairs_of_equal_label, sorted_unique
from bestview.association.sightings import TrackObservations

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
MINIMUM_FRAME_SCORE = -2.0
"""Least score of a frame, reached 1.7 gates apart: larger distances add nothing."""
_ROUNDING_MARGIN = 1.0 + 1e-6
"""Factor on the search radius, against rounding."""
_BANDS = 0.5
"""Bands per square root of the number of rectangles."""


def pairs_in_one_camera_frame(rows: Ints, camera: Ints) -> tuple[Ints, Ints]:
    """Return the pairs of rows that were seen in one frame of one camera, each at least once: (P,) and (P,).

    Args:
        rows: (T, W) row of each track's sighting by frame, -1: hidden.
        camera: (T,) number of each track's camera.
    """
    first, second = pairs_of_equal_label(camera)
    first_row, second_row = rows[first], rows[second]
    both = (first_row >= 0) & (second_row >= 0) & (first_row != second_row)
    # A pair is usually the same in every frame: its first frame is enough.
    both[:, 1:] &= (
        ~both[:, :-1] | (first_row[:, 1:] != first_row[:, :-1]) | (second_row[:, 1:] != second_row[:, :-1])
    )
    return first_row[both], second_row[both]


@dataclass(frozen=True, slots=True, eq=False)
class GroundProximity:
    """Ground scores of P pairs of rows of different cameras that were localized in the same frames.

    Attributes:
        first: (P,) rows.
        second: (P,) rows, above `first`; a pair occurs once, or once for each track of a settled person.
        score: (P,) sums over frames.
        frame_count: (P,) frames.
    """

    first: Ints
    second: Ints
    score: Floats
    frame_count: Ints


@dataclass(frozen=True, slots=True, eq=False)
class GroundTrajectories:
    """Ground positions of L trajectories, one for each pair of track and row of the update, ordered by row.

    A track that is split within the update has two trajectories, and a row with several settled tracks has
    one for each.

    Attributes:
        row: (L,) rising.
        camera: (L,) number of the track's camera.
        positions: (5, L, W) x, y and the covariances xx, xy, yy in ground units; NaN where not localized.
        sighting_rows: (S,) row of each sighting.
        sighting_frames: (S,) frame of each sighting.
    """

    row: Ints
    camera: Ints
    positions: Floats
    sighting_rows: Ints
    sighting_frames: Ints

    @classmethod
    def of(cls, observations: TrackObservations, rows: Ints, camera: Ints) -> GroundTrajectories:
        """Build trajectories from (T, W) `rows` of the observations, -1: hidden, and (T,) camera indices."""
        known = np.isfinite(observations.ground_point[..., 0]) & np.isfinite(
            observations.ground_covariance[..., 0, 0]
        )
        track, frame = np.nonzero(known & (rows >= 0))
        code = rows[track, frame] * max(len(rows), 1) + track
        code, first, line = np.unique(code, return_index=True, return_inverse=True)
        where = np.full((5, code.size, rows.shape[1]), np.nan)
        where[:2, line, frame] = observations.ground_point[track, frame].T
        where[2:, line, frame] = observations.ground_covariance[track, frame][:, [0, 0, 1], [0, 1, 1]].T
        row = rows[track, frame]
        return cls(row[first], camera[track[first]], where, row, observations.first_frame + frame)

    def scores(self, first: Ints, second: Ints, gate: float) -> Floats:
        """Compute the score of (P,) pairs of trajectories in each frame: (P, W); NaN: not localized."""
        x, y = self.positions[:2, first] - self.positions[:2, second]
        xx, xy, yy = self.positions[2:, first] + self.positions[2:, second]
        xx, yy = xx + gate**2, yy + gate**2
        # Squared length of (x, y) in the metric of the inverse covariance, the 2x2 inverse written out.
        squared = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)
        return np.asarray(np.maximum(1.0 - squared, MINIMUM_FRAME_SCORE))

    def candidate_pairs(self, gate: float) -> tuple[Ints, Ints]:
        """Return pairs of trajectories that may score above the minimum, lower first: (P,) and (P,)."""
        xx, xy, yy = self.positions[2:]
        longest = (xx + yy) / 2.0 + np.hypot((xx - yy) / 2.0, xy)
        # D^2 is at least the squared distance over gate^2 and both longest variances together.
        reach = np.sqrt((1.0 - MINIMUM_FRAME_SCORE) * (longest + gate**2 / 2.0) * _ROUNDING_MARGIN)
        lower = np.fmin.reduce(self.positions[:2] - reach, axis=-1, initial=np.nan)
        upper = np.fmax.reduce(self.positions[:2] + reach, axis=-1, initial=np.nan)
        return overlapping_rectangles(lower.T, upper.T)


def score_ground_proximity(
    trajectories: GroundTrajectories, gate: float, active_rows: int, known_pairs: tuple[Ints, Ints], rows: int
) -> GroundProximity:
    """Score how close to each other the trajectories of different cameras are.

    The score of a frame is ``1 - D^2``, at least -2, where D is the distance of the foot points in gates: 1
    at the same place, 0 one gate apart. Where foot points are uncertain, which is along the line of sight,
    the gate is stretched by their covariance. Pairs that have never scored above -2, now or before, are left
    out.

    Args:
        trajectories: ground positions.
        gate: distance at which two foot points are as likely of one person as of two, ground units.
        active_rows: rows from this one on are settled people: two of them are not compared.
        known_pairs: pairs of rows that were scored before, (P,) and (P,), the lower row first.
        rows: how many there are.
    """
    one, two = trajectories.candidate_pairs(gate)
    compared = (trajectories.row[one] < active_rows) & (trajectories.camera[one] != trajectories.camera[two])
    one, two = one[compared], two[compared]
    above_minimum = (trajectories.scores(one, two, gate) > MINIMUM_FRAME_SCORE).any(axis=1)
    start, stop = (
        np.searchsorted(trajectories.row, np.arange(rows), side=side) for side in ("left", "right")
    )
    lower, higher = known_pairs
    present = (lower < active_rows) & (stop[lower] > start[lower]) & (stop[higher] > start[higher])
    new_pairs = trajectories.row[one[above_minimum]] * rows + trajectories.row[two[above_minimum]]
    pair = sorted_unique(np.concatenate([new_pairs, lower[present] * rows + higher[present]]))
    # All trajectories of both: an active row has one, unless its track is split within the update.
    first, second = pair // max(rows, 1), pair % max(rows, 1)
    owner, which = expand_counts((stop[first] - start[first]) * (stop[second] - start[second]))
    first, second, width = first[owner], second[owner], (stop[second] - start[second])[owner]
    one, two = start[first] + which // width, start[second] + which % width
    different = trajectories.camera[one] != trajectories.camera[two]
    first, second, one, two = first[different], second[different], one[different], two[different]
    score = trajectories.scores(one, two, gate)
    localized = ~np.isnan(score)
    total, frames = np.zeros(one.size), localized.sum(axis=1)
    # Frame by frame, so that sums do not depend on how NumPy adds.
    for column in range(score.shape[1]):
        total += np.where(localized[:, column], score[:, column], 0.0)
    scored = frames > 0
    return GroundProximity(first[scored], second[scored], total[scored], frames[scored])


def overlapping_rectangles(low: Floats, high: Floats) -> tuple[Ints, Ints]:
    """Return the pairs of rectangles that overlap, each once: (P,) and (P,), the lower index first, in order.

    The plane is cut into bands with equally many rectangles, and in each band a line sweeps over them
    (Bentley and Wood, 1980), so that time is linear in the number of rectangles if each meets a few.

    Args:
        low: (N, 2) lower corners.
        high: (N, 2) upper corners, not below.
    """
    count = len(low)
    middle = np.sort(low[:, 1] + high[:, 1]) / 2.0
    bands = max(1, int(_BANDS * np.sqrt(count)))
    edges = middle[np.arange(1, bands) * count // bands]
    first, last = (np.searchsorted(edges, side[:, 1], side="right") for side in (low, high))
    item, which = expand_counts(last - first + 1)
    band = first[item] + which
    # Ranks along the sweep instead of coordinates, so that band and rank make one sort key.
    along = np.argsort(low[:, 0], kind="stable")
    place = np.empty(count, dtype=np.int64)
    place[along] = np.arange(count)
    stop = np.searchsorted(low[along, 0], high[:, 0], side="right")
    key = band * (count + 1) + place[item]
    order = np.argsort(key)
    item, band, key = item[order], band[order], key[order]
    reach = np.searchsorted(key, band * (count + 1) + stop[item])
    at, which = expand_counts(reach - np.arange(key.size) - 1)
    one, two = item[at], item[at + 1 + which]
    overlapping = (low[one, 1] <= high[two, 1]) & (low[two, 1] <= high[one, 1])
    # A pair that shares several bands counts in the first of them.
    overlapping &= band[at] == np.maximum(first[one], first[two])
    one, two = np.minimum(one, two)[overlapping], np.maximum(one, two)[overlapping]
    order = np.lexsort((two, one))
    return one[order], two[order]
