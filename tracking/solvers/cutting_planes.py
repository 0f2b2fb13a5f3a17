"""Conflict rows, added when a point of the relaxation violates them: few of them are ever binding."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools, clique_rows, connected_component
from tracking.model.network import Network
from tracking.solvers.objective import Ints
from tracking.solvers.warm_start import ConflictPrice

_TOLERANCE = 1e-9
"""Rows count as violated beyond the feasibility tolerance of the LP solver."""


@dataclass(frozen=True, slots=True, eq=False)
class ConflictRow:
    """At most one path passes through `members` (n, S) of `frame`; the occlusion is never a member."""

    frame: int
    members: Bools


@dataclass(frozen=True, slots=True, eq=False)
class _ConflictComponent:
    """The rows of a connected component of conflicting places in one frame.

    Attributes:
        rows: (R, P K), or (R, n K) for stars: the entries of each row.
    """

    rows: Floats


class RowMembers:
    """The members of conflict rows in one array: which paths are in which rows, what nodes pay."""

    def __init__(self, network: Network) -> None:
        objects, states = network.objects, network.max_places + 1
        self._alike = network.shared and network.conflict_rows == "clique"
        """Whether rows are the same for each object."""
        self._frames = np.empty(0, dtype=np.int64)
        self._members = np.empty((0, 1 if self._alike else objects, states), dtype=np.bool_)

    def add(self, rows: Sequence[ConflictRow]) -> None:
        """Add rows."""
        if rows:
            members = [row.members[:1] if self._alike else row.members for row in rows]
            self._members = np.concatenate([self._members, np.array(members)])
            self._frames = np.concatenate([self._frames, [row.frame for row in rows]])

    def of_paths(self, owners: Ints, nodes: Ints) -> Bools:
        """Return which rows the paths `nodes` (P, M) of `owners` (P,) are in, (P, R)."""
        owner = np.zeros_like(owners) if self._alike else owners
        return np.asarray(self._members[np.arange(len(self._frames)), owner[:, None], nodes[:, self._frames]])

    def of_arcs(self, owners: Ints, frames: Ints, nodes: Ints) -> tuple[Ints, Ints]:
        """Return pairs of arc and row, both (X,): arcs (A,) of `owners` into `nodes` of `frames`."""
        owner = np.zeros_like(owners) if self._alike else owners
        arcs, rows = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for frame in np.unique(self._frames).tolist():
            into, limited = np.flatnonzero(frames == frame), np.flatnonzero(self._frames == frame)
            row, arc = np.nonzero(self._members[limited][:, owner[into], nodes[into]])
            arcs.append(into[arc])
            rows.append(limited[row])
        return np.concatenate(arcs), np.concatenate(rows)

    def add_prices(self, node: Floats, prices: Floats) -> Floats:
        """Return node costs `node` (n, M, S) with prices (R,) of the first R rows."""
        sheet = np.zeros((self._members.shape[1], *node.shape[1:]))
        for row in np.flatnonzero(prices > 0.0).tolist():
            sheet[:, self._frames[row]] += prices[row] * self._members[row]
        return node + sheet


def conflict_prices(
    network: Network, rows: Sequence[ConflictRow], prices: Floats
) -> tuple[ConflictPrice, ...]:
    """Return the rows with a positive price; none for star rows or separate observations."""
    if not network.shared or network.conflict_rows == "star":
        return ()
    return tuple(
        ConflictPrice(row.frame, tuple(np.flatnonzero(row.members[0]).tolist()), float(price))
        for row, price in zip(rows, prices, strict=True)
        if price > 0.0
    )


class ConflictSeparator:
    """Finds the rows of `Network.rows` that a point violates; it returns each row once."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._stars = network.conflict_rows == "star"
        self._relation = network.conflicts.astype(np.float64)
        self._components: dict[tuple[int, int], _ConflictComponent] = {}
        self._returned: set[tuple[int, bytes]] = set()

    def find_new_violated(self, usage: Floats) -> list[ConflictRow]:
        """Return the rows that y = `usage` (n, M, S) violates and that were not returned before."""
        found: list[ConflictRow] = []
        visits = self._visits(usage)
        around = (self._relation @ visits[:, :, None])[:, :, 0]
        # Places whose conflicting places carry more than one path; without any, no row is violated.
        suspects = around > 1.0 + _TOLERANCE
        if self._network.shared and not self._stars and suspects.any():
            for frame, place in self._whole_cliques(suspects):
                suspects[frame, place] = False
                self._add_new(found, frame, self._relation[frame, place])
        for frame in np.flatnonzero(suspects.any(axis=1)).tolist():
            flow = usage[:, frame, :-1].ravel() if self._stars else visits[frame]
            for component in self._components_at(frame, np.flatnonzero(suspects[frame])):
                for row in component.rows[component.rows @ flow > 1.0 + _TOLERANCE]:
                    self._add_new(found, frame, row)
        return found

    def _whole_cliques(self, suspects: Bools) -> Iterator[tuple[int, int]]:
        """Yield frame and place of the suspects (M, K) whose component is one clique.

        Each place that they conflict with conflicts with the same places.
        """
        frames, places = np.nonzero(suspects)
        own = self._network.conflicts[frames, places]
        differs = (self._network.conflicts[frames] != own[:, None]).any(axis=2)
        alike = ~(differs & own).any(axis=1)
        yield from zip(frames[alike].tolist(), places[alike].tolist(), strict=True)

    def _add_new(self, found: list[ConflictRow], frame: int, row: Floats) -> None:
        """Add a row to `found` if it was not returned before."""
        key = (frame, row.tobytes())
        if key not in self._returned:
            self._returned.add(key)
            found.append(self._row(frame, row))

    def match_prices(self, rows: Sequence[ConflictPrice]) -> tuple[list[ConflictRow], list[float]]:
        """Return those of the rows, with their prices, that are rows of this network."""
        found: list[ConflictRow] = []
        prices: list[float] = []
        if not self._network.shared or self._stars:
            return found, prices
        for row in rows:
            member = np.zeros(self._network.max_places)
            if row.frame >= self._network.frames:
                continue
            present = np.flatnonzero(self._network.present[0, row.frame])
            known = [place for place in row.places if place in present]
            if not known:
                continue
            member[known] = 1.0
            for component in self._components_at(row.frame, np.array(known[:1])):
                if (component.rows == member).all(axis=1).any():
                    found.append(self._row(row.frame, member))
                    prices.append(row.price)
        return found, prices

    def take_new(self, rows: Sequence[ConflictRow]) -> list[ConflictRow]:
        """Return those of the rows that were not returned before, and mark them as returned."""
        keys = [(row.frame, self._entries(row).tobytes()) for row in rows]
        found = {key: row for key, row in zip(keys, rows, strict=True) if key not in self._returned}
        self._returned.update(found)
        return list(found.values())

    def _entries(self, row: ConflictRow) -> Floats:
        members = row.members[:, :-1] if not self._network.shared or self._stars else row.members[0, :-1]
        return np.asarray(members, dtype=np.float64).ravel()

    def _visits(self, usage: Floats) -> Floats:
        """Return the flow through each place, (M, P K)."""
        if self._network.shared:
            return np.asarray(usage[:, :, :-1].sum(axis=0))
        return np.swapaxes(usage[:, :, :-1], 0, 1).reshape(self._network.frames, -1)

    def _row(self, frame: int, row: Floats) -> ConflictRow:
        network = self._network
        members = np.zeros((network.objects, network.max_places + 1), dtype=np.bool_)
        members[:, :-1] = row.reshape(-1, network.max_places) > 0.0
        return ConflictRow(frame, members)

    def _components_at(self, frame: int, places: Ints) -> list[_ConflictComponent]:
        """Return the distinct components of places of a frame."""
        if self._stars:
            if (frame, 0) not in self._components:
                rows = self._network.rows(frame)
                self._components[frame, 0] = _ConflictComponent(
                    rows.reshape(len(rows), -1).astype(np.float64)
                )
            return [self._components[frame, 0]]
        components = {}
        for place in places.tolist():
            if (frame, place) not in self._components:
                self._cover(frame, place)
            component = self._components[frame, place]
            components[id(component)] = component
        return list(components.values())

    def _cover(self, frame: int, place: int) -> None:
        """Compute the rows of a place's component."""
        relation, owners = self._network.conflicts[frame], self._network.owners
        inside = connected_component(relation, place)
        cliques = clique_rows(relation[np.ix_(inside, inside)], None if owners is None else owners[inside])
        rows = np.zeros((len(cliques), len(relation)))
        rows[:, inside] = cliques
        component = _ConflictComponent(rows)
        for member in inside.tolist():
            self._components[frame, member] = component


def group_objects(linked: Bools) -> Ints:
    """Return the lowest object of each object's group, (n,); `linked` (n, n) is symmetric."""
    reached = linked | np.eye(len(linked), dtype=np.bool_)
    while True:
        further = reached @ reached
        if (further == reached).all():
            return np.asarray(reached.argmax(axis=1))
        reached = further
