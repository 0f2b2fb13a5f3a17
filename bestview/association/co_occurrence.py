"""Which tracks of an update were seen at once, and how near to each other they stood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.association.index_ranges import distinct, pairs_within, written_out
from bestview.association.sightings import Sightings
from bestview.geometry.rectangle_overlap import overlapping

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WORST = -2.0
"""Least score of a frame: feet 1.7 gates apart or 17 say the same."""
_SLACK = 1.0 + 1e-6
"""What rounding may make of a reach."""


def at_once(rows: Ints, camera: Ints) -> tuple[Ints, Ints]:
    """Give the pairs of rows that were seen in one frame of one camera, each at least once: (P,) and (P,).

    Args:
        rows: (T, W) of each track's sightings by frame, -1: hidden.
        camera: (T,) number of each track's camera.
    """
    one, two = pairs_within(camera)
    a, b = rows[one], rows[two]
    both = (a >= 0) & (b >= 0) & (a != b)
    # Mostly a pair is the same in every frame: the first one will do.
    both[:, 1:] &= ~both[:, :-1] | (a[:, 1:] != a[:, :-1]) | (b[:, 1:] != b[:, :-1])
    return a[both], b[both]


@dataclass(frozen=True, slots=True, eq=False)
class Nearness:
    """What an update says about P pairs of rows of different cameras that stood somewhere at once.

    Attributes:
        one: (P,) rows.
        two: (P,) rows, above `one`; a pair is there once, or once for each track of somebody settled.
        score: (P,) sums over frames.
        frames: (P,) how many.
    """

    one: Ints
    two: Ints
    score: Floats
    frames: Ints


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """Where L lines stand on the ground: a line for each track and row of the update, in the order of rows.

    A track that is cut within the update has two lines, and a row whose tracks are settled one for each.

    Attributes:
        row: (L,) rising.
        camera: (L,) number of the track's camera.
        where: (5, L, W) place x, y and its covariance xx, xy, yy, ground units; NaN where it stands nowhere.
        rows: (S,) of each sighting.
        frames: (S,) likewise, the number of the frame.
    """

    row: Ints
    camera: Ints
    where: Floats
    rows: Ints
    frames: Ints

    @classmethod
    def of(cls, seen: Sightings, rows: Ints, camera: Ints) -> Standing:
        """Collect them: (T, W) `rows` of the sightings, -1: hidden, and (T,) `camera` of the tracks."""
        known = np.isfinite(seen.ground[..., 0]) & np.isfinite(seen.spread[..., 0, 0])
        track, frame = np.nonzero(known & (rows >= 0))
        code = rows[track, frame] * max(len(rows), 1) + track
        code, first, line = np.unique(code, return_index=True, return_inverse=True)
        where = np.full((5, code.size, rows.shape[1]), np.nan)
        where[:2, line, frame] = seen.ground[track, frame].T
        where[2:, line, frame] = seen.spread[track, frame][:, [0, 0, 1], [0, 1, 1]].T
        row = rows[track, frame]
        return cls(row[first], camera[track[first]], where, row, seen.first + frame)

    def scores(self, one: Ints, two: Ints, gate: float) -> Floats:
        """Score (P,) pairs of lines in each frame: (P, W); NaN where not both stand somewhere."""
        x, y = self.where[:2, one] - self.where[:2, two]
        xx, xy, yy = self.where[2:, one] + self.where[2:, two]
        xx, yy = xx + gate**2, yy + gate**2
        # Squared length of (x, y) in the metric of the inverse covariance, the 2x2 inverse written out.
        squared = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)
        return np.asarray(np.maximum(1.0 - squared, WORST))

    def close(self, gate: float) -> tuple[Ints, Ints]:
        """Give the pairs of lines that might score more than the least: (P,) and (P,), the lower first."""
        xx, xy, yy = self.where[2:]
        longest = (xx + yy) / 2.0 + np.hypot((xx - yy) / 2.0, xy)
        # D^2 is at least the squared distance over gate^2 and both longest variances together.
        reach = np.sqrt((1.0 - WORST) * (longest + gate**2 / 2.0) * _SLACK)
        low = np.fmin.reduce(self.where[:2] - reach, axis=-1, initial=np.nan)
        high = np.fmax.reduce(self.where[:2] + reach, axis=-1, initial=np.nan)
        return overlapping(low.T, high.T)


def near(stands: Standing, gate: float, open_rows: int, met: tuple[Ints, Ints], rows: int) -> Nearness:
    """Score how near to each other different cameras' tracks stand.

    The score of a frame is ``1 - D^2``, at least -2, with D the distance of the feet in gates: 1 for the
    very same place, 0 a gate apart. Where feet are uncertain, which is along the lines of sight, the gate
    is stretched by their covariance. Pairs that have never scored more than -2, now or before, are left out.

    Args:
        stands: who stands where.
        gate: distance at which feet are as likely one person's as two's, ground units.
        open_rows: rows from this one on are settled: two of them are not compared.
        met: pairs of rows that have met before, (P,) and (P,), the lower row first.
        rows: how many there are.
    """
    one, two = stands.close(gate)
    asked = (stands.row[one] < open_rows) & (stands.camera[one] != stands.camera[two])
    one, two = one[asked], two[asked]
    meet = (stands.scores(one, two, gate) > WORST).any(axis=1)
    first, last = (np.searchsorted(stands.row, np.arange(rows), side=side) for side in ("left", "right"))
    again = (met[0] < open_rows) & (last[met[0]] > first[met[0]]) & (last[met[1]] > first[met[1]])
    pair = np.concatenate(
        [stands.row[one[meet]] * rows + stands.row[two[meet]], met[0][again] * rows + met[1][again]]
    )
    pair = distinct(pair)
    # All lines of both: an open row has one, unless its track is cut and begins anew within the update.
    a, b = pair // max(rows, 1), pair % max(rows, 1)
    of, which = written_out((last[a] - first[a]) * (last[b] - first[b]))
    a, b, wide = a[of], b[of], (last[b] - first[b])[of]
    one, two = first[a] + which // wide, first[b] + which % wide
    different = stands.camera[one] != stands.camera[two]
    a, b, one, two = a[different], b[different], one[different], two[different]
    score = stands.scores(one, two, gate)
    there = ~np.isnan(score)
    total, frames = np.zeros(one.size), there.sum(axis=1)
    # One after the other, in the order of the frames, whatever NumPy would do.
    for column in range(score.shape[1]):
        total += np.where(there[:, column], score[:, column], 0.0)
    stood = frames > 0
    return Nearness(a[stood], b[stood], total[stood], frames[stood])
