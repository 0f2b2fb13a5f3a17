"""Shares of all paths instead of the cheapest one: a path of cost c counts exp(-c / temperature).

They change smoothly with the costs, so that prices can follow them in long steps, where the cheapest path
jumps. They are of single precision, and approximate where a path has almost no share: they show a direction,
and prove nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.solvers.objective import Ints
from tracking.solvers.sparse_trellis import SparseTrellis

Singles = NDArray[np.float32]

_LEAST_EXPONENT = np.float32(-50.0)
"""Products with shares stay above the smallest normal number, below which arithmetic is slow."""

_LEAST_SHARE = np.float32(1e-9)
"""Added to the share of each state, so that a state can follow that no likely one leads to."""

_LEAST_ARC = np.float32(1e-12)
"""Added to the share of each arc, for the same reason."""


@dataclass(frozen=True, slots=True, eq=False)
class PathShares:
    """Shares of the paths of each object.

    Attributes:
        arcs: (n, E) the shares of arcs, which sum to 1 in each step.
        nodes: (n, M, S) those of states.
    """

    arcs: Singles
    nodes: Singles


@dataclass(frozen=True, slots=True, eq=False)
class _Sweep:
    """A step of the forward pass, and the step as far from the end of the backward pass, as one.

    The states that the forward pass reaches are 0 to S - 1, those of the backward pass S to 2 S - 1.

    Attributes:
        span: where the arcs of both are in the lists of the sweeps.
        before: (A,) the state that each arc continues from.
        starts: (G,) the first arc of each group that leads to one state.
        reached: (G,) that state.
        passes: (2,) the first group of each pass.
        counts: (2,) their groups.
    """

    span: slice
    before: Ints
    starts: Ints
    reached: Ints
    passes: Ints
    counts: Ints


class SoftPaths:
    """The paths of a trellis, ready for their shares at changing costs."""

    def __init__(self, trellis: SparseTrellis) -> None:
        self._trellis = trellis
        states, steps = trellis.states, trellis.steps
        self._starts = np.array([step.span.start for step in steps])
        parts, self._sweeps, first = [], [], 0
        for ahead, back in zip(steps, reversed(steps), strict=True):
            parts += [np.arange(ahead.span.start, ahead.span.stop), back.order + back.span.start]
            count = len(ahead.origin)
            last = first + count + len(back.origin)
            self._sweeps.append(
                _Sweep(
                    slice(first, last),
                    np.concatenate([ahead.origin, states + back.target[back.order]]),
                    np.concatenate([ahead.entering.starts, count + back.leaving.starts]),
                    np.concatenate([ahead.entering.states, states + back.leaving.states]),
                    np.array([0, len(ahead.entering.starts)]),
                    np.array([len(ahead.entering.starts), len(back.leaving.starts)]),
                )
            )
            first = last
        self._order = np.concatenate(parts)
        # After so many sweeps the passes have reached the ends of each arc.
        sweeps = len(steps)
        self._behind = 2 * states * trellis.step + trellis.origin
        self._ahead = 2 * states * (sweeps - 1 - trellis.step) + states + trellis.target
        self._entering = np.concatenate([step.entering.starts + step.span.start for step in steps])
        self._entered = trellis.step[self._entering] * states + trellis.target[self._entering]

    def shares(self, costs: Singles, temperature: float) -> PathShares:
        """Return the shares at the costs of arcs, (n, E), which are overwritten."""
        step, starts, states = self._trellis.step, self._starts, self._trellis.states
        costs -= np.minimum.reduceat(costs, starts, axis=1).take(step, axis=1)
        costs *= np.float32(-1.0 / temperature)
        np.maximum(costs, _LEAST_EXPONENT, out=costs)
        shares = np.exp(costs, out=costs)
        reached = self._reached(shares.take(self._order, axis=1))
        shares *= reached.take(self._behind, axis=1)
        shares *= reached.take(self._ahead, axis=1)
        shares /= np.add.reduceat(shares, starts, axis=1).take(step, axis=1)
        frames = len(starts) + 1
        nodes = np.zeros((len(shares), frames * states), dtype=np.float32)
        nodes[:, states + self._entered] = np.add.reduceat(shares, self._entering, axis=1)
        first = self._trellis.steps[0]
        leaving = shares[:, first.order]
        nodes[:, first.leaving.states] = np.add.reduceat(leaving, first.leaving.starts, axis=1)
        shares += _LEAST_ARC
        return PathShares(shares, nodes.reshape(len(shares), frames, states))

    def _reached(self, shares: Singles) -> Singles:
        """Return the shares, up to factors, of the paths to each state and on from it, (n, sweeps * 2 S).

        `shares` are those of arcs in the order of the sweeps.
        """
        states = self._trellis.states
        reached = np.zeros((len(self._sweeps), len(shares), 2 * states), dtype=np.float32)
        reached[0] = 1.0
        for k, sweep in enumerate(self._sweeps[:-1]):
            arcs = reached[k].take(sweep.before, axis=1)
            arcs *= shares[:, sweep.span]
            found = np.add.reduceat(arcs, sweep.starts, axis=1)
            found /= np.add.reduceat(found, sweep.passes, axis=1).repeat(sweep.counts, axis=1)
            found += _LEAST_SHARE
            reached[k + 1][:, sweep.reached] = found
        return np.swapaxes(reached, 0, 1).reshape(len(shares), -1)
