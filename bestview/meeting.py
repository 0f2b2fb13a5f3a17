"""Which tracks of an update were seen at once, and how near to each other they stood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.sightings import Sightings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_WORST = -2.0
"""Least score of a frame: feet 1.7 gates apart or 17 say the same."""


def at_once(rows: Ints, camera: Ints) -> tuple[Ints, Ints]:
    """Give the pairs of rows that were seen in one frame of one camera, each at least once: (P,) and (P,).

    Args:
        rows: (T, W) of each track's sightings by frame, -1: hidden.
        camera: (T,) number of each track's camera.
    """
    one, two = np.nonzero(np.triu(camera[:, None] == camera, 1))
    both = (rows[one] >= 0) & (rows[two] >= 0) & (rows[one] != rows[two])
    return rows[one][both], rows[two][both]


@dataclass(frozen=True, slots=True, eq=False)
class Nearness:
    """What an update says about P pairs of rows of different cameras that stood somewhere at once.

    Attributes:
        one: (P,) rows.
        two: (P,) rows; a pair is there once, or once for each track of somebody settled.
        score: (P,) sums over frames.
        frames: (P,) how many.
    """

    one: Ints
    two: Ints
    score: Floats
    frames: Ints


def near(seen: Sightings, rows: Ints, camera: Ints, gate: float, open_rows: int) -> Nearness:
    """Score how near to each other different cameras' tracks stand.

    The score of a frame is ``1 - D^2``, at least -2, with D the distance of the feet in gates: 1 for the
    very same place, 0 a gate apart. Where feet are uncertain, which is along the lines of sight, the gate
    is stretched by their covariance.

    Args:
        seen: the tracks.
        rows: (T, W) of their sightings, -1: hidden.
        camera: (T,) number of each track's camera.
        gate: distance at which feet are as likely one person's as two's, ground units.
        open_rows: rows from this one on are settled: two of them are not compared.
    """
    known = np.isfinite(seen.ground[..., 0]) & np.isfinite(seen.spread[..., 0, 0])
    track, frame = np.nonzero(known & (rows >= 0))
    # One line for each track and row: a track that is cut within the update has two, and a row whose tracks
    # are settled one for each of them.
    code = rows[track, frame] * max(len(rows), 1) + track
    code, first, line = np.unique(code, return_index=True, return_inverse=True)
    row, camera = rows[track[first], frame[first]], camera[track[first]]
    # Lines are in the order of the rows: those of open episodes come first.
    count = int(np.searchsorted(row, open_rows))
    one, two = np.nonzero(np.triu(camera[:count, None] != camera, 1))
    spread = seen.spread[track, frame]
    stands = np.full((rows.shape[1], 5, code.size), np.nan)
    stands[frame, :2, line] = seen.ground[track, frame]
    stands[frame, 2:, line] = spread[:, [0, 0, 1], [0, 1, 1]]
    score, frames = np.zeros(one.shape), np.zeros(one.shape, dtype=np.int64)
    for x, y, *about in stands:
        dx, dy = x[one] - x[two], y[one] - y[two]
        xx, xy, yy = (part[one] + part[two] for part in about)
        xx, yy = xx + gate**2, yy + gate**2
        # Squared length of (dx, dy) in the metric of the inverse covariance, the 2x2 inverse written out.
        squared = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)
        there = ~np.isnan(squared)
        score += np.where(there, np.maximum(1.0 - squared, _WORST), 0.0)
        frames += there
    met = frames > 0
    return Nearness(row[one[met]], row[two[met]], score[met], frames[met])
