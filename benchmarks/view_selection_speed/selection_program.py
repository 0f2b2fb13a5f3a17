"""Times of the view selection program on random costs."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from bestview import select_views

_SEED = 3
_SWITCH_COST = 7.5


@dataclass(frozen=True, slots=True)
class ProgramSize:
    """The size of a selection problem."""

    objects: int
    cameras: int
    lookahead: int
    gop: int
    least_shot: int
    """GOPs."""


def frame_time(size: ProgramSize, repeats: int) -> float:
    """Return the median seconds per frame; one choice serves all frames of a GOP."""
    rng = np.random.default_rng(_SEED)
    # The service's memory layout: objects innermost.
    cost = rng.random((size.lookahead, size.cameras, size.objects)).transpose(2, 0, 1)
    previous = rng.integers(0, size.cameras, size.objects)
    held = rng.integers(1, max(2, size.least_shot), size.objects)
    starts = np.arange(size.lookahead) % size.gop == 0
    spent = []
    for _ in range(repeats):
        begin = time.process_time()
        select_views(cost, previous, _SWITCH_COST, starts, size.least_shot, held, decided_gops=1)
        spent.append(time.process_time() - begin)
    return float(np.median(spent)) / size.gop
