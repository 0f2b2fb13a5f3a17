"""The most likely disjoint paths of any number of people over a grid (k shortest paths).

Berclaz, Fleuret, Turetken and Fua, "Multiple object tracking using k-shortest paths optimization", IEEE
PAMI 2011. The min-cost flow is computed path by path, each the shortest in the residual network of the
others (Suurballe), until no further path has a negative cost. Costs are integers, so the result is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Ints: TypeAlias = NDArray[np.int64]

INFINITE = np.int64(2**60)
"""An infinite cost."""
_NONE, _END = -1, -2
_SOURCE, _BACK = -1, -2


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """The places over time, as a network.

    Attributes:
        costs: (T, L) of being at a place: negative where that is likely.
        moves: (L, K) the places reachable from each in one frame, itself included; L: none. Symmetric.
        gates: (L,) the cost of entering, and of leaving, at each place; free in the first and the last frame.
    """

    costs: Ints
    moves: Ints
    gates: Ints


@dataclass(frozen=True, slots=True, eq=False)
class GridPath:
    """The path of one person: `places` (F,) from the frame `first` on."""

    first: int
    places: Ints


def shortest_paths(lattice: Lattice) -> list[GridPath]:
    """Return the paths of least total cost, by their first frame and place."""
    flow = _Flow(lattice)
    while flow.augment():
        pass
    return flow.paths()


class _Flow:
    """The current paths and their residual network.

    Every place in every frame is two nodes, *in* and *out*, joined by an arc of capacity one with the cost of
    being there. An arc in use can be reversed, at minus its cost.
    """

    def __init__(self, lattice: Lattice) -> None:
        self._frames, self._places = lattice.costs.shape
        self._costs, self._gates = lattice.costs, lattice.gates
        self._moves = lattice.moves
        shape = lattice.costs.shape
        self._used = np.zeros(shape, dtype=np.bool_)
        self._after = np.full(shape, _NONE, dtype=np.int64)
        self._before = np.full(shape, _NONE, dtype=np.int64)
        self._in = np.empty(shape, dtype=np.int64)
        # One more column for moves that lead nowhere.
        self._out = np.empty((self._frames, self._places + 1), dtype=np.int64)
        self._from = np.empty(shape, dtype=np.int64)

    def augment(self) -> bool:
        """Add the shortest path if that lowers the cost; return whether it does."""
        self._compute_distances()
        ends = self._out[:, :-1] + self._gates
        ends[-1] = self._out[-1, :-1]
        frame, place = divmod(int(ends.argmin()), self._places)
        if ends[frame, place] >= 0:
            return False
        self._add_path(frame, place)
        return True

    def paths(self) -> list[GridPath]:
        """Return the current paths."""
        result = []
        for first, place in zip(*np.nonzero(self._used & (self._before == _END)), strict=True):
            frame, current, places = int(first), int(place), []
            while current != _END:
                places.append(current)
                current = int(self._after[frame, current])
                frame += 1
            result.append(GridPath(int(first), np.array(places, dtype=np.int64)))
        return result

    def _compute_distances(self) -> None:
        """Compute the distance of every node from the source (Bellman-Ford).

        All arcs lead to the next frame, except the reversed ones on the current paths. So frames are relaxed
        forwards, then the paths backwards, until no distance changes.
        """
        self._in[:] = self._gates
        self._in[0] = 0
        self._from[:] = _SOURCE
        self._out[:] = INFINITE
        changed = np.ones(self._frames, dtype=np.bool_)
        while changed.any():
            self._relax_forwards(changed)
            changed = self._relax_backwards()

    def _relax_forwards(self, changed: NDArray[np.bool_]) -> None:
        """Relax forwards from the frames whose *out* nodes got `changed`, which marks more of them."""
        rows = np.arange(self._places)
        for frame in range(self._frames):
            again = bool(changed[frame])
            if frame and changed[frame - 1]:
                reached = self._out[frame - 1][self._moves]
                choice = reached.argmin(axis=1)
                value = reached[rows, choice]
                better = value < self._in[frame]
                if better.any():
                    self._in[frame][better] = value[better]
                    self._from[frame][better] = self._moves[better, choice[better]]
                    again = True
            if again:
                free = ~self._used[frame]
                there = self._in[frame] + self._costs[frame]
                self._out[frame, :-1][free] = there[free]
                changed[frame] = True

    def _relax_backwards(self) -> NDArray[np.bool_]:
        """Relax reversed arcs; return the frames (T,) whose *out* nodes got nearer."""
        changed = np.zeros(self._frames, dtype=np.bool_)
        for frame in range(self._frames - 2, -1, -1):
            places = np.flatnonzero(self._after[frame] >= 0)
            value = self._in[frame + 1][self._after[frame][places]]
            better = value < self._out[frame][places]
            if not better.any():
                continue
            places, value = places[better], value[better]
            self._out[frame][places] = value
            changed[frame] = True
            value = value - self._costs[frame][places]
            better = value < self._in[frame][places]
            self._in[frame][places[better]] = value[better]
            self._from[frame][places[better]] = _BACK
        return changed

    def _add_path(self, frame: int, place: int) -> None:
        """Add the shortest path that ends at a place; arcs that it reverses are removed first."""
        links: list[tuple[int, int, int]] = []
        removed: list[tuple[int, int, int]] = []
        nodes: list[tuple[int, int]] = []
        removed_nodes: list[tuple[int, int]] = []
        last = (frame, place)
        while True:
            # At the out node: reached from its own in node, or by reversing the arc after it.
            while self._used[frame, place]:
                after = int(self._after[frame, place])
                removed.append((frame, place, after))
                frame, place = frame + 1, after
                if self._from[frame, place] != _BACK:
                    break
                removed_nodes.append((frame, place))
            else:
                nodes.append((frame, place))
            previous = int(self._from[frame, place])
            if previous == _SOURCE:
                break
            links.append((frame - 1, previous, place))
            frame, place = frame - 1, previous
        self._apply(removed, removed_nodes, nodes, links)
        self._before[frame, place] = _END
        self._after[last] = _END

    def _apply(
        self,
        removed: list[tuple[int, int, int]],
        removed_nodes: list[tuple[int, int]],
        nodes: list[tuple[int, int]],
        links: list[tuple[int, int, int]],
    ) -> None:
        for frame, one, other in removed:
            self._after[frame, one] = self._before[frame + 1, other] = _NONE
        for node in removed_nodes:
            self._used[node] = False
        for node in nodes:
            self._used[node] = True
        for frame, one, other in links:
            self._after[frame, one] = other
            self._before[frame + 1, other] = one
