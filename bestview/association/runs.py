"""Runs of consecutive observations of a track with the same crowding."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class ObservationRun(NamedTuple):
    """Consecutive observations of a track from column `start` on, all crowded or all uncrowded."""

    track: int
    start: int
    stop: int
    crowded: bool


def observation_runs(
    visible: NDArray[np.bool_], crowded: NDArray[np.bool_], *, whole: bool
) -> Iterator[ObservationRun]:
    """Yield runs of observations, (T, W) visible and crowded: only the first frame can start a tracklet.

    `whole`: runs are as long as possible; else each is one frame.
    """
    kind = np.where(visible, 1 + crowded, 0)
    kind = np.pad(kind, ((0, 0), (1, 1)))
    change = (kind[:, 1:] != kind[:, :-1]) | (not whole)
    track, start = np.nonzero(change[:, :-1] & visible)
    # As many end as begin, in the same order.
    _, stop = np.nonzero(change[:, 1:] & visible)
    for run in zip(
        track.tolist(), start.tolist(), (stop + 1).tolist(), crowded[track, start].tolist(), strict=True
    ):
        yield ObservationRun(*run)
