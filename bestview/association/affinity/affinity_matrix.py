"""What is known about pairs of episodes and people: tables that follow who is in play.

The rows are the open episodes, then the people who have settled ones, in the order in which others list
them. Evidence is summed up as it comes in: a pair is never looked at again. Only pairs of which there is
more to say than that they are elsewhere have an entry, so that a site of many cameras is no square.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.association.affinity.pair_table import PairTable, once
from bestview.association.co_occurrence import WORST
from bestview.association.index_ranges import written_out
from bestview.association.keys import EpisodeKey
from bestview.association.presence import Presence
from bestview.association.settings import IdentitySettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_LEAST_COMMON = 3
"""Frames in which two must both be seen before their places say anything."""
_BEFORE = 256
"""Frames before the last sighting of somebody recent in which it counts who else was about."""

Row = EpisodeKey | int
"""An open episode, or the number of a person who has settled ones."""


class PairTables:
    """Symmetric tables over N rows.

    Args:
        settings: of identity.
    """

    def __init__(self, settings: IdentitySettings) -> None:
        self._cap, self._memory, self._cap_alike = (
            settings.maximum_ground_evidence,
            settings.cross_camera_memory,
            settings.maximum_cross_camera_evidence,
        )
        self._frames = settings.ground_correlation_frames
        self._place: dict[Row, int] = {}
        # What the tables call each row, and no other one later.
        self._name: Ints = np.zeros(0, dtype=np.int64)
        self._names = 0
        self._presence = Presence(settings.comparable_frames + _BEFORE)
        # Frames of being elsewhere after which more of them say nothing more.
        self._enough = max(
            _LEAST_COMMON,
            math.ceil(settings.maximum_ground_evidence * settings.ground_correlation_frames / -WORST),
        )
        self._apart = PairTable()
        self._alike = PairTable()
        # Evidence of standing on the same ground, and in how many frames; no more than says anything.
        self._near = PairTable(2)

    def __len__(self) -> int:
        """Count the rows."""
        return len(self._place)

    @property
    def entries(self) -> int:
        """How many pairs have an entry in some table."""
        return len(self._apart) + len(self._alike) + len(self._near)

    def arrange(self, rows: Sequence[Row]) -> None:
        """Go over to these rows: those that were here keep what is known about them."""
        if rows == list(self._place):
            return
        old = np.array([self._place.get(row, -1) for row in rows], dtype=np.int64)
        self._presence.arrange(old)
        new = old < 0
        name = np.where(new, 0, self._name[old] if self._name.size else 0)
        name[new] = self._names + np.arange(int(new.sum()))
        self._names += int(new.sum())
        gone = np.setdiff1d(self._name, name)
        self._name = name
        self._place = {row: i for i, row in enumerate(rows)}
        if gone.size:
            for table in (self._apart, self._alike, self._near):
                table.keep(~(np.isin(table.one, gone) | np.isin(table.two, gone)))

    def make_room(self, rows: Iterable[Row]) -> None:
        """Add those of these rows that are not here yet; nothing is known about them."""
        new = [row for row in dict.fromkeys(rows) if row not in self._place]
        self.arrange([*self._place, *new])

    def add_apart(self, one: Ints, two: Ints) -> None:
        """Note (P,) pairs of rows that were seen at once in one camera."""
        one, two = self._names_of(one, two)
        new = self._apart.find(one, two) < 0
        one, two = once(one[new], two[new])
        self._apart.put(one, two, np.ones((one.size, 1)))

    def set_apart(self, one: Sequence[Row], two: Sequence[Row]) -> None:
        """Note that each of some rows is another person than each of some others, as if seen at once."""
        rows = [[self._place[it] for it in side if it in self._place] for side in (one, two)]
        first, second = np.meshgrid(*(np.array(side, dtype=np.int64) for side in rows))
        self.add_apart(first.ravel(), second.ravel())

    def apart(self, one: Ints, two: Ints) -> NDArray[np.bool_]:
        """Say of (P,) pairs of rows whether they were seen at once in one camera: two people."""
        return self._apart.find(*self._names_of(one, two)) >= 0

    def any_apart(self, one: Sequence[int], two: Sequence[int]) -> bool:
        """Say whether any of some rows was seen at once in one camera with any of some others."""
        first, second = np.meshgrid(np.array(one, dtype=np.int64), np.array(two, dtype=np.int64))
        return bool(self.apart(first.ravel(), second.ravel()).any())

    def met(self) -> tuple[Ints, Ints]:
        """Give the pairs of rows that have an entry of nearness, the lower row first: (P,) and (P,)."""
        one, two = self._rows_of(self._near.one), self._rows_of(self._near.two)
        return np.minimum(one, two), np.maximum(one, two)

    def near(self, one: Ints, two: Ints) -> Floats:
        """Evidence of (P,) pairs of rows of standing on the same ground: (P,)."""
        evidence, common = self._nearness(*self._names_of(one, two), one, two).T
        return np.asarray(np.where(common >= _LEAST_COMMON, evidence, 0.0))

    def add_near(self, one: Ints, two: Ints, score: Floats, frames: Ints) -> None:
        """Add what some frames say about how near (P,) pairs of rows stand; whom both `stand` notes later.

        The sum stays within the cap: what was said long ago can be taken back.
        """
        pair, where = np.unique(np.minimum(one, two) * len(self) + np.maximum(one, two), return_inverse=True)
        one, two = pair // max(len(self), 1), pair % max(len(self), 1)
        a, b = self._names_of(one, two)
        known = self._nearness(a, b, one, two)
        np.add.at(known[:, 0], where, score / self._frames)
        np.add.at(known[:, 1], where, frames)
        known[:, 0] = np.clip(known[:, 0], -self._cap, self._cap)
        known[:, 1] = np.minimum(known[:, 1], _LEAST_COMMON)
        self._near.put(a, b, known)

    def stand(self, row: Ints, frame: Ints) -> None:
        """Note that (P,) rows stood somewhere on the ground in (P,) frames.

        Whom they have not met was elsewhere.
        """
        self._presence.stand(row, frame)
        # Who went their ways for good is elsewhere like anybody else.
        at = np.flatnonzero(self._near.value[:, 0] <= -self._cap)
        one, two = self._rows_of(self._near.one[at]), self._rows_of(self._near.two[at])
        keep = np.ones(len(self._near), dtype=np.bool_)
        keep[at] = self._elsewhere(one, two)[:, 0] > -self._cap
        self._near.keep(keep)

    def alike(self, one: Ints, two: Ints) -> Floats:
        """Evidence of looks of (P,) pairs of rows between cameras without a common ground: (P,)."""
        return self._alike.get(*self._names_of(one, two))[:, 0]

    def all_alike(self) -> tuple[Ints, Ints]:
        """Give the pairs of rows that have an entry of looks: (P,) and (P,), the lower row first."""
        one, two = self._rows_of(self._alike.one), self._rows_of(self._alike.two)
        return np.minimum(one, two), np.maximum(one, two)

    def add_alike(self, one: Ints, two: Ints, score: Floats) -> None:
        """Add what an update says about the looks of (P,) pairs of rows, each pair once."""
        one, two = self._names_of(one, two)
        known = self._alike.get(one, two)[:, 0]
        value = np.clip(self._memory * known + score, -self._cap_alike, self._cap_alike)
        self._alike.put(one, two, value[:, None])
        self._alike.keep(self._alike.value[:, 0] != 0)

    def absorb(self, pairs: Sequence[tuple[Row, Row]]) -> None:
        """Add what is known about rows to others: the two are one.

        Args:
            pairs: who is kept, who is lost; nobody is both.
        """
        pairs = [(kept, lost) for kept, lost in pairs if lost in self._place]
        if not pairs:
            return
        kept, lost = (np.array([self._place[it[side]] for it in pairs], dtype=np.int64) for side in (0, 1))
        into = np.arange(len(self))
        into[lost] = kept
        self._absorb_near(into)
        self._presence.absorb(kept, lost)
        self._apart, self._alike = (
            table.renamed(*(self._name[into[self._rows_of(side)]] for side in (table.one, table.two)))
            for table in (self._apart, self._alike)
        )

    def _absorb_near(self, into: Ints) -> None:
        """Sum up nearness: (N,) `into` which row each one goes."""
        # Of each row all that go there, itself too.
        order = np.argsort(into, kind="stable")
        begin, end = (np.searchsorted(into[order], np.arange(into.size), side=it) for it in ("left", "right"))
        size = end - begin
        one, two = into[self._rows_of(self._near.one)], into[self._rows_of(self._near.two)]
        touched = (size[one] > 1) | (size[two] > 1)
        one, two = once(one[touched], two[touched])
        different = one != two
        one, two = one[different], two[different]
        # Whoever of one side has no entry with somebody of the other was elsewhere.
        pair, which = written_out(size[one] * size[two])
        a = order[begin[one][pair] + which // size[two][pair]]
        b = order[begin[two][pair] + which % size[two][pair]]
        known = self._nearness(*self._names_of(a, b), a, b)
        total = np.bincount(pair, known[:, 0], one.size)
        common = np.zeros(one.size)
        np.maximum.at(common, pair, known[:, 1])
        self._near.keep(~touched)
        self._near.put(*self._names_of(one, two), np.stack([total, common], axis=1))

    def _nearness(self, a: Ints, b: Ints, one: Ints, two: Ints) -> Floats:
        """Evidence and frames of (P,) pairs, by names and by rows: (P, 2)."""
        at = self._near.find(a, b)
        known = np.empty((at.size, 2))
        there = at >= 0
        known[there] = self._near.value[at[there]]
        known[~there] = self._elsewhere(one[~there], two[~there])
        return known

    def _elsewhere(self, one: Ints, two: Ints) -> Floats:
        """Evidence and frames of (P,) pairs of rows that never met: (P, 2)."""
        common = self._presence.common(one, two, self._enough).astype(np.float64)
        evidence = np.maximum(WORST * common / self._frames, -self._cap)
        return np.stack([evidence, np.minimum(common, _LEAST_COMMON)], axis=1)

    def _names_of(self, one: Ints, two: Ints) -> tuple[Ints, Ints]:
        return self._name[one], self._name[two]

    def _rows_of(self, names: Ints) -> Ints:
        order = np.argsort(self._name)
        return order[np.searchsorted(self._name, names, sorter=order)]
