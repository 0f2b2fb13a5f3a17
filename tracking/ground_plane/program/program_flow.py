"""The relaxation of a program as flows along its arcs: one of each known person, and one of all newcomers.

It is that of paper II.D without what a network of all states has to list: only useful arcs are columns, and
newcomers, who are alike, are one flow. Where its optimum is integral, as it nearly always is, it is that of
the program.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.ground_plane.program.costs import Ints, MoveArcs, ProgramCosts
from tracking.ground_plane.program.useful_arcs import GONE, HIDDEN
from tracking.model.conflicts import clique_rows
from tracking.solvers.programs.linear_program import LinearProgram, LinearProgramBuilder

_TOLERANCE = 1e-6
"""Distance from whole numbers up to which a flow is integral."""
_NONE = np.zeros(0, dtype=np.int64)
_NO_MOVES = MoveArcs(_NONE, _NONE, _NONE, np.zeros(0))


@dataclass(frozen=True, slots=True, eq=False)
class _Arcs:
    """Arcs of one kind, (E,): whose, from and to which place or `HIDDEN`, and their columns."""

    row: Ints
    origin: Ints
    target: Ints
    column: Ints

    def select(self, chosen: NDArray[np.bool_]) -> _Arcs:
        """Return some of the arcs."""
        return _Arcs(self.row[chosen], self.origin[chosen], self.target[chosen], self.column[chosen])


class ProgramFlow:
    """The linear program of a window.

    Its nodes are the places that somebody can take, and being hidden in a frame for each known person.
    Whoever is gone has left the program. `conflicts` (K, K): of each frame, places of which only one can be
    taken.
    """

    def __init__(self, costs: ProgramCosts, conflicts: Sequence[NDArray[np.bool_]]) -> None:
        self._costs, self._known, self._frames = costs, costs.people, len(conflicts)
        self._build = LinearProgramBuilder()
        shape = (self._known, self._frames)
        self._begin = self._build.add_rows(self._known, 1.0, 1.0)
        self._hidden = self._build.add_rows(self._known * self._frames, 0.0, 0.0).reshape(shape)
        self._stay = self._build.add_columns(costs.hidden[: self._known].ravel()).reshape(shape)
        """Columns of being hidden in a frame, and in the one before if there is one."""
        self._enter: list[_Arcs] = []
        """Arcs into the places of each frame from being hidden, or from outside."""
        self._move: list[_Arcs] = []
        """Arcs into the places of each frame from those of the one before."""
        self._hide: list[_Arcs] = []
        """Arcs from the places of each frame but the last to being hidden in the next."""
        self._add_hiding()
        nodes = np.zeros((self._known + 1, 0), dtype=np.int64)
        for m, places in enumerate(conflicts):
            nodes = self._add_places(m, nodes)
            self._add_leaving(m, nodes)
            self._add_conflicts(m, places)
        self.program: LinearProgram = self._build.program()

    def states(self, values: NDArray[np.float64]) -> Ints | None:
        """Return the states that the columns' `values` say, (n, M); None: they are fractional.

        First those of the people known, then of those who arrive, by the first frame in which they are there.
        """
        whole = np.rint(values)
        if np.abs(values - whole).max(initial=0.0) > _TOLERANCE:
            return None
        used = whole > 0.0
        return np.concatenate([self._known_states(used), *self._arrivals(used)])

    def _add_hiding(self) -> None:
        """Add the known people who are hidden from the first frame on, stay hidden, or leave."""
        build, leave = self._build, np.full(self._hidden.shape, self._costs.leave)
        leave[:, -1] = 0.0  # the window ends
        build.add_entries(self._begin, self._stay[:, 0], 1.0)
        build.add_entries(self._begin, build.add_columns(np.full(self._known, self._costs.leave)), 1.0)
        build.add_entries(self._hidden, self._stay, 1.0)
        build.add_entries(self._hidden[:, :-1], self._stay[:, 1:], -1.0)
        build.add_entries(self._hidden.ravel(), build.add_columns(leave.ravel()), -1.0)

    def _add_places(self, m: int, before: Ints) -> Ints:
        """Add the arcs into the places of a frame.

        Returns:
            (R, K) the program's rows of the places, -1 where nobody can be; `before`: of the frame before.
        """
        costs, build = self._costs, self._build
        arcs = costs.steps[m - 1] if m else _NO_MOVES
        taken = np.isfinite(costs.reach[m])
        row, place = np.nonzero(taken)
        taken[arcs.row, arcs.target] = True
        nodes = np.full(taken.shape, -1)
        nodes[taken] = build.add_rows(int(taken.sum()), 0.0, 0.0)

        enter = build.add_columns(costs.reach[m][row, place] + costs.node[m][row, place])
        build.add_entries(nodes[row, place], enter, 1.0)
        known = row < self._known
        hidden, sign = (self._hidden[row[known], m - 1], -1.0) if m else (self._begin[row[known]], 1.0)
        build.add_entries(hidden, enter[known], sign)
        self._enter.append(_Arcs(row, np.full(len(row), HIDDEN), place, enter))

        move = build.add_columns(arcs.cost + costs.node[m][arcs.row, arcs.target])
        build.add_entries(before[arcs.row, arcs.origin], move, -1.0)
        build.add_entries(nodes[arcs.row, arcs.target], move, 1.0)
        self._move.append(_Arcs(arcs.row, arcs.origin, arcs.target, move))
        return nodes

    def _add_leaving(self, m: int, nodes: Ints) -> None:
        """Add the arcs from places to being gone, and those of known people to being hidden."""
        build, is_last = self._build, m == self._frames - 1
        row, place = np.nonzero(nodes >= 0)
        leave = build.add_columns(np.full(len(row), 0.0 if is_last else self._costs.leave))
        build.add_entries(nodes[row, place], leave, -1.0)
        if is_last:
            return
        row, place = np.nonzero(nodes[: self._known] >= 0)
        hide = build.add_columns(self._costs.hidden[row, m + 1])
        build.add_entries(nodes[row, place], hide, -1.0)
        build.add_entries(self._hidden[row, m + 1], hide, 1.0)
        self._hide.append(_Arcs(row, place, np.full(len(row), HIDDEN), hide))

    def _add_conflicts(self, m: int, conflicts: NDArray[np.bool_]) -> None:
        """Add the cliques of places of a frame of which only one can be taken."""
        cliques = clique_rows(conflicts, None)
        rows = self._build.add_rows(len(cliques), -np.inf, 1.0)
        place, clique = np.nonzero(cliques.T)
        begins = np.searchsorted(place, np.arange(len(conflicts) + 1))
        for arcs in (self._enter[m], self._move[m]):
            # Each arc is in all cliques of its place: those from `begins[place]` on, so many.
            count = np.diff(begins)[arcs.target]
            first = np.repeat(begins[arcs.target] - np.cumsum(count) + count, count)
            self._build.add_entries(
                rows[clique[first + np.arange(len(first))]], np.repeat(arcs.column, count), 1.0
            )

    def _known_states(self, used: NDArray[np.bool_]) -> Ints:
        """Return the states of the known people, (P, M)."""
        states = np.full((self._known, self._frames), GONE)
        states[used[self._stay]] = HIDDEN
        for m, hide in enumerate(self._hide):
            states[hide.row[used[hide.column]], m + 1] = HIDDEN
        for m in range(self._frames):
            for arcs in (self._enter[m], self._move[m]):
                taken = arcs.select(used[arcs.column] & (arcs.row < self._known))
                states[taken.row, m] = taken.target
        return states

    def _arrivals(self, used: NDArray[np.bool_]) -> list[Ints]:
        """Return the states of each newcomer who arrives, (1, M)."""
        arrived: list[Ints] = []
        before: dict[int, Ints] = {}  # by place
        for m in range(self._frames):
            here: dict[int, Ints] = {}
            entered, moved = (
                arcs.select(used[arcs.column] & (arcs.row == self._known))
                for arcs in (self._enter[m], self._move[m])
            )
            for place in sorted(entered.target.tolist()):
                here[place] = np.full((1, self._frames), GONE)
                here[place][0, :m] = HIDDEN
                arrived.append(here[place])
            for origin, target in zip(moved.origin.tolist(), moved.target.tolist(), strict=True):
                here[target] = before[origin]
            for place, states in here.items():
                states[0, m] = place
            before = here
        return arrived
