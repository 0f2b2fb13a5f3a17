"""Conflict rows, found when a point of the relaxation breaks them: few of them ever bind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools, clique_rows, connected_places
from tracking.model.network import Network
from tracking.solvers.objective import Ints
from tracking.solvers.warm_start import ConflictPrice

_TOLERANCE = 1e-9
"""Rows are broken beyond the feasibility tolerance of the LP solver only."""


@dataclass(frozen=True, slots=True, eq=False)
class ConflictRow:
    """At most one path goes through `members` (n, S) of `frame`; the occlusion is never a member."""

    frame: int
    members: Bools


@dataclass(frozen=True, slots=True, eq=False)
class _ConflictComponent:
    """The rows of places of one frame that conflict with each other, directly or through others.

    Attributes:
        rows: (R, P K), or (R, n K) where the rows are stars: the entries of each row.
    """

    rows: Floats


def conflict_prices(
    network: Network, rows: Sequence[ConflictRow], prices: Floats
) -> tuple[ConflictPrice, ...]:
    """Return the rows with a price, if all objects share them."""
    if not network.shared or network.conflict_rows == "star":
        return ()
    return tuple(
        ConflictPrice(row.frame, tuple(np.flatnonzero(row.members[0]).tolist()), float(price))
        for row, price in zip(rows, prices, strict=True)
        if price > 0.0
    )


class ConflictSeparator:
    """Finds the rows of a network that a point breaks; the rows are those of `Network.rows`."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._stars = network.conflict_rows == "star"
        self._relation = network.conflicts.astype(np.float64)
        self._parts: dict[tuple[int, int], _ConflictComponent] = {}
        self._given: set[tuple[int, bytes]] = set()

    def find_violated(self, usage: Floats) -> list[ConflictRow]:
        """Return the rows that y = `usage` (n, M, S) breaks and that were not given before."""
        found = []
        visits = self._visits(usage)
        around = (self._relation @ visits[:, :, None])[:, :, 0]
        # More than one path in all that a place conflicts with; without such a place no row is broken.
        suspects = around > 1.0 + _TOLERANCE
        for frame in np.flatnonzero(suspects.any(axis=1)).tolist():
            there = usage[:, frame, :-1].ravel() if self._stars else visits[frame]
            for part in self._parts_at(frame, np.flatnonzero(suspects[frame])):
                for row in part.rows[part.rows @ there > 1.0 + _TOLERANCE]:
                    key = (frame, row.tobytes())
                    if key not in self._given:
                        self._given.add(key)
                        found.append(self._row(frame, row))
        return found

    def match_prices(self, rows: Sequence[ConflictPrice]) -> tuple[list[ConflictRow], list[float]]:
        """Return those rows, and their prices, that are rows of this network, given before or not."""
        found: list[ConflictRow] = []
        prices: list[float] = []
        if not self._network.shared or self._stars:
            return found, prices
        for row in rows:
            member = np.zeros(self._network.places)
            if row.frame >= self._network.frames:
                continue
            there = np.flatnonzero(self._network.present[0, row.frame])
            known = [place for place in row.places if place in there]
            if not known:
                continue
            member[known] = 1.0
            for part in self._parts_at(row.frame, np.array(known[:1])):
                if (part.rows == member).all(axis=1).any():
                    found.append(self._row(row.frame, member))
                    prices.append(row.price)
        return found, prices

    def drop_known(self, rows: Sequence[ConflictRow]) -> list[ConflictRow]:
        """Return those of the rows that were not given before; from now on they were."""
        keys = [(row.frame, self._entries(row).tobytes()) for row in rows]
        found = {key: row for key, row in zip(keys, rows, strict=True) if key not in self._given}
        self._given.update(found)
        return list(found.values())

    def _entries(self, row: ConflictRow) -> Floats:
        members = row.members[:, :-1] if not self._network.shared or self._stars else row.members[0, :-1]
        return np.asarray(members, dtype=np.float64).ravel()

    def _visits(self, usage: Floats) -> Floats:
        """Return how much goes through each place, (M, P K)."""
        if self._network.shared:
            return np.asarray(usage[:, :, :-1].sum(axis=0))
        return np.swapaxes(usage[:, :, :-1], 0, 1).reshape(self._network.frames, -1)

    def _row(self, frame: int, row: Floats) -> ConflictRow:
        network = self._network
        members = np.zeros((network.objects, network.places + 1), dtype=np.bool_)
        members[:, :-1] = row.reshape(-1, network.places) > 0.0
        return ConflictRow(frame, members)

    def _parts_at(self, frame: int, places: Ints) -> list[_ConflictComponent]:
        """Return the parts that places of a frame are in, each once."""
        if self._stars:
            if (frame, 0) not in self._parts:
                rows = self._network.rows(frame)
                self._parts[frame, 0] = _ConflictComponent(rows.reshape(len(rows), -1).astype(np.float64))
            return [self._parts[frame, 0]]
        parts = {}
        for place in places.tolist():
            if (frame, place) not in self._parts:
                self._cover(frame, place)
            part = self._parts[frame, place]
            parts[id(part)] = part
        return list(parts.values())

    def _cover(self, frame: int, place: int) -> None:
        """Compute the rows of the part that a place is in."""
        relation, owners = self._network.conflicts[frame], self._network.owners
        inside = connected_places(relation, place)
        cliques = clique_rows(relation[np.ix_(inside, inside)], None if owners is None else owners[inside])
        rows = np.zeros((len(cliques), len(relation)))
        rows[:, inside] = cliques
        part = _ConflictComponent(rows)
        for member in inside.tolist():
            self._parts[frame, member] = part


def group_objects(meets: Bools) -> Ints:
    """Return the lowest object of the group of each, (n,); `meets` (n, n) is symmetric."""
    reached = meets | np.eye(len(meets), dtype=np.bool_)
    while True:
        further = reached @ reached
        if (further == reached).all():
            return np.asarray(reached.argmax(axis=1))
        reached = further
