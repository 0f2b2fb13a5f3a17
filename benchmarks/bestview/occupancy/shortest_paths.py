"""The likeliest paths of any number of people over a grid, no two at one place at once.

Berclaz, Fleuret, Turetken and Fua, "Multiple object tracking using k-shortest paths optimization", IEEE
PAMI 2011. The flow of least cost is found path by path, each the shortest in what the others leave
(Suurballe), until no further path has a negative cost. Costs are whole numbers, so that it is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Ints: TypeAlias = NDArray[np.int64]

NOWHERE = np.int64(2**60)
"""A cost that nobody pays."""
_NONE, _END = -1, -2
_SOURCE, _BACK = -1, -2


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Places over time.

    Attributes:
        costs: (T, L) of being at a place: the logarithm of how unlikely that is; negative where likely.
        moves: (L, K) the places that can be reached from each in one frame, itself among them; L is none.
            Whoever can go somewhere can come back.
        gates: (L,) what entering costs at each place, and what leaving does. Before the first frame and
            after the last it costs nothing.
    """

    costs: Ints
    moves: Ints
    gates: Ints


@dataclass(frozen=True, slots=True, eq=False)
class GridPath:
    """Where one person is: the frame `first` and the `places` (F,) from there on."""

    first: int
    places: Ints


def shortest_paths(lattice: Lattice) -> list[GridPath]:
    """Return the paths of least total cost, by their first frame and place."""
    flow = _Flow(lattice)
    while flow.augment():
        pass
    return flow.paths()


class _Flow:
    """Paths so far, and the network that they leave.

    Every place at every frame is two nodes, *in* and *out*, joined by an arc that costs what it costs to be
    there and can be used once. An arc in use can be taken back: it leads the other way at minus its cost.
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
        # One column more, which is nowhere, for moves that lead there.
        self._out = np.empty((self._frames, self._places + 1), dtype=np.int64)
        self._from = np.empty(shape, dtype=np.int64)

    def augment(self) -> bool:
        """Add the shortest path, if that lowers the cost."""
        self._measure()
        ends = self._out[:, :-1] + self._gates
        ends[-1] = self._out[-1, :-1]
        frame, place = divmod(int(ends.argmin()), self._places)
        if ends[frame, place] >= 0:
            return False
        self._take(frame, place)
        return True

    def paths(self) -> list[GridPath]:
        """Return the paths that are in use."""
        found = []
        for first, place in zip(*np.nonzero(self._used & (self._before == _END)), strict=True):
            frame, here, places = int(first), int(place), []
            while here != _END:
                places.append(here)
                here = int(self._after[frame, here])
                frame += 1
            found.append(GridPath(int(first), np.array(places, dtype=np.int64)))
        return found

    def _measure(self) -> None:
        """Find how far every node is from the source (Bellman and Ford).

        All arcs lead to the next frame, but those that take something back, which are on the paths in use.
        So frame after frame is looked at forwards, then the paths backwards, until nothing is nearer.
        """
        self._in[:] = self._gates
        self._in[0] = 0
        self._from[:] = _SOURCE
        self._out[:] = NOWHERE
        nearer = np.ones(self._frames, dtype=np.bool_)
        while nearer.any():
            self._forwards(nearer)
            nearer = self._backwards()

    def _forwards(self, nearer: NDArray[np.bool_]) -> None:
        """Go on from the frames whose *out* nodes are `nearer`, and from all that are so by that."""
        rows = np.arange(self._places)
        for frame in range(self._frames):
            again = bool(nearer[frame])
            if frame and nearer[frame - 1]:
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
                nearer[frame] = True

    def _backwards(self) -> NDArray[np.bool_]:
        """Take paths in use back; give the frames (T,) whose *out* nodes are nearer by that."""
        nearer = np.zeros(self._frames, dtype=np.bool_)
        for frame in range(self._frames - 2, -1, -1):
            places = np.flatnonzero(self._after[frame] >= 0)
            value = self._in[frame + 1][self._after[frame][places]]
            better = value < self._out[frame][places]
            if not better.any():
                continue
            places, value = places[better], value[better]
            self._out[frame][places] = value
            nearer[frame] = True
            value = value - self._costs[frame][places]
            better = value < self._in[frame][places]
            self._in[frame][places[better]] = value[better]
            self._from[frame][places[better]] = _BACK
        return nearer

    def _take(self, frame: int, place: int) -> None:
        """Put the shortest path to leaving at a place into use; what it takes back goes first."""
        links: list[tuple[int, int, int]] = []
        taken: list[tuple[int, int, int]] = []
        nodes: list[tuple[int, int]] = []
        emptied: list[tuple[int, int]] = []
        last = (frame, place)
        while True:
            # At the out node: it was come to from its own in node, or by taking back the arc after it.
            while self._used[frame, place]:
                after = int(self._after[frame, place])
                taken.append((frame, place, after))
                frame, place = frame + 1, after
                if self._from[frame, place] != _BACK:
                    break
                emptied.append((frame, place))
            else:
                nodes.append((frame, place))
            came = int(self._from[frame, place])
            if came == _SOURCE:
                break
            links.append((frame - 1, came, place))
            frame, place = frame - 1, came
        self._put(taken, emptied, nodes, links)
        self._before[frame, place] = _END
        self._after[last] = _END

    def _put(
        self,
        taken: list[tuple[int, int, int]],
        emptied: list[tuple[int, int]],
        nodes: list[tuple[int, int]],
        links: list[tuple[int, int, int]],
    ) -> None:
        for frame, one, other in taken:
            self._after[frame, one] = self._before[frame + 1, other] = _NONE
        for node in emptied:
            self._used[node] = False
        for node in nodes:
            self._used[node] = True
        for frame, one, other in links:
            self._after[frame, one] = other
            self._before[frame + 1, other] = one
