"""Conflict rows, found when a point of the relaxation breaks them: few of them ever bind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.conflicts import Bools, clique_rows, connected
from tracking.network import Network

_TOLERANCE = 1e-9
"""Rows are broken beyond the feasibility tolerance of the LP solver only."""


@dataclass(frozen=True, slots=True, eq=False)
class ConflictRow:
    """At most one path goes through `members` (n, S) of `frame`; the occlusion is never a member."""

    frame: int
    members: Bools


class ConflictFinder:
    """Finds the rows of a network that a point breaks; the rows are those of `Network.rows`."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._relation = network.conflicts.astype(np.float64)
        self._rows: dict[tuple[int, int], Bools] = {}
        self._given: set[tuple[int, bytes]] = set()

    def broken(self, usage: Floats) -> list[ConflictRow]:
        """Give the rows that y = `usage` (n, M, S) breaks and that were not given before."""
        network, found = self._network, []
        for frame, place in self._suspects(usage):
            rows = self._rows_at(frame, place)
            sums = rows.reshape(len(rows), -1) @ usage[:, frame, :-1].ravel()
            for row in rows[sums > 1.0 + _TOLERANCE]:
                key = (frame, row.tobytes())
                if key not in self._given:
                    self._given.add(key)
                    members = np.zeros((network.objects, network.places + 1), dtype=np.bool_)
                    members[:, :-1] = row
                    found.append(ConflictRow(frame, members))
        return found

    def _suspects(self, usage: Floats) -> list[tuple[int, int]]:
        """Give frames and places with more than one path in all they conflict with; no row else breaks."""
        network = self._network
        if network.shared:
            visits = usage[:, :, :-1].sum(axis=0)
        else:
            visits = np.swapaxes(usage[:, :, :-1], 0, 1).reshape(network.frames, -1)
        around = (self._relation @ visits[:, :, None])[:, :, 0]
        return [(int(m), int(i)) for m, i in np.argwhere(around > 1.0 + _TOLERANCE)]

    def _rows_at(self, frame: int, place: int) -> Bools:
        """Give rows (R, n, K), all those that `place` of `frame` may be a reason to break."""
        network = self._network
        if network.conflict_rows == "star":
            place = 0
            if (frame, place) not in self._rows:
                self._rows[frame, place] = network.rows(frame)
            return self._rows[frame, place]
        if (frame, place) not in self._rows:
            self._cover(frame, place)
        return self._rows[frame, place]

    def _cover(self, frame: int, place: int) -> None:
        """Compute the rows of the connected part that a place is in."""
        network = self._network
        relation, owners = network.conflicts[frame], network.owners
        part = connected(relation, place)
        cliques = clique_rows(relation[np.ix_(part, part)], None if owners is None else owners[part])
        flat = np.zeros((len(cliques), len(relation)), dtype=np.bool_)
        flat[:, part] = cliques
        rows = flat.reshape(len(flat), len(network.boxes), network.places)
        rows = np.broadcast_to(rows, (len(rows), network.objects, network.places))
        for member in part:
            self._rows[frame, int(member)] = rows
