"""Lists of the arcs that exist, grouped by step and state: gated windows have few of the pairs of states."""

from __future__ import annotations

from collections.abc import Iterator
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


def existing_arcs(pair: Floats, node: Floats) -> tuple[Ints, Ints, Ints]:
    """Return step, origin and target (E,) of the arcs that any object has, sorted by step, target, origin.

    `pair` (Q, M - 1, S, S) and `node` (n, M, S) are the costs of a network.
    """
    exists = np.isfinite(pair).any(axis=0)
    usable = np.asarray(np.isfinite(node).any(axis=0))
    exists &= usable[:-1, :, None] & usable[1:, None]
    step, target, origin = np.nonzero(np.swapaxes(exists, 1, 2))
    return step, origin, target


def group_by_step(
    count: int, step: Ints, origin: Ints, target: Ints, order: Ints | None = None
) -> tuple[StepArcs, ...]:
    """Return the arcs of each of `count` steps, from lists (E,) that are sorted as in `existing_arcs`.

    `order` (E,) sorts them all by step, origin, target, if that is known.
    """
    ends = np.searchsorted(step, np.arange(count + 1))
    states = 1 + int(max(origin.max(initial=0), target.max(initial=0)))
    if order is None:
        order = np.argsort(step * states + origin, kind="stable")
    entering = _groups(ends, step * states, target)
    leaving = _groups(ends, step * states, origin[order])
    return tuple(
        StepArcs(
            slice(first, last),
            origin[first:last],
            target[first:last],
            next(entering),
            order[first:last] - first,
            next(leaving),
        )
        for first, last in pairwise(ends.tolist())
    )


def _groups(ends: Ints, base: Ints, states: Ints) -> Iterator[ArcGroups]:
    """Yield the groups of each step; `base` and `states` (E,) ascend together within each step."""
    starts = np.flatnonzero(np.diff(base + states, prepend=-1))
    shared = states[starts]
    bounds = np.searchsorted(starts, ends)
    for first, (begin, end) in zip(ends.tolist(), pairwise(bounds.tolist()), strict=False):
        yield ArcGroups(starts[begin:end] - first, shared[begin:end])
