"""Lists of the arcs that exist, grouped by step and state: gated windows have few of the pairs of states."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class ArcGroups:
    """The arcs of a step that share a state, one after another, for sums and minima over each group.

    Attributes:
        starts: (G,) the first arc of each group.
        states: (G,) the state that the arcs of a group share.
    """

    starts: Ints
    states: Ints

    @classmethod
    def of(cls, sorted_states: Ints) -> ArcGroups:
        """Group arcs by their states, (E,), ascending."""
        starts = np.flatnonzero(np.diff(sorted_states, prepend=-1))
        return cls(starts, sorted_states[starts])


@dataclass(frozen=True, slots=True, eq=False)
class StepArcs:
    """The arcs between two frames, sorted by target, then origin.

    Attributes:
        span: where they are in the lists of all arcs.
        origin, target: (E,) their states.
        entering: groups by target.
        order: (E,) sorts them by origin, then target.
        leaving: groups by origin, in that order.
    """

    span: slice
    origin: Ints
    target: Ints
    entering: ArcGroups
    order: Ints
    leaving: ArcGroups

    @classmethod
    def of(cls, span: slice, origin: Ints, target: Ints) -> StepArcs:
        """Group the arcs of a step."""
        order = np.argsort(origin, kind="stable")
        return cls(span, origin, target, ArcGroups.of(target), order, ArcGroups.of(origin[order]))


def existing_arcs(pair: Floats, node: Floats) -> tuple[Ints, Ints, Ints]:
    """Return step, origin and target (E,) of the arcs that any object has, sorted by step, target, origin.

    `pair` (Q, M - 1, S, S) and `node` (n, M, S) are the costs of a network.
    """
    exists = np.isfinite(pair).any(axis=0)
    usable = np.asarray(np.isfinite(node).any(axis=0))
    exists &= usable[:-1, :, None] & usable[1:, None]
    step, target, origin = np.nonzero(np.swapaxes(exists, 1, 2))
    return step, origin, target


def group_by_step(count: int, step: Ints, origin: Ints, target: Ints) -> tuple[StepArcs, ...]:
    """Return the arcs of each of `count` steps, from lists (E,) that are sorted as in `existing_arcs`."""
    ends = np.searchsorted(step, np.arange(count + 1))
    spans = [slice(int(first), int(last)) for first, last in pairwise(ends)]
    return tuple(StepArcs.of(span, origin[span], target[span]) for span in spans)
