"""Sightings run by run: consecutive frames of a track that are alike."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Run(NamedTuple):
    """Consecutive sightings of a track, from column `start` on, all in a crowd or none."""

    track: int
    start: int
    stop: int
    crowded: bool


def runs_of(visible: NDArray[np.bool_], crowded: NDArray[np.bool_], *, whole: bool) -> Iterator[Run]:
    """Part the sightings, (T, W) which and whether in a crowd: only the first of a run can begin an episode.

    `whole`: runs are as long as can be; else each is one frame.
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
        yield Run(*run)
