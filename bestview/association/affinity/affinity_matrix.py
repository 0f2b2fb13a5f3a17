"""Affinity matrix: sparse evidence about pairs of tracklets and people, with rows that come and go.

The rows are the active tracklets, then the people with settled tracklets. Evidence is summed up update by
update and never recomputed. Only pairs with more evidence than having been at different places at the same
time have an entry, so memory grows with encounters instead of with the square of the site's people.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.association.affinity.localized_frames import LocalizedFrames
from bestview.association.affinity.pair_table import SparsePairTable, unique_pairs
from bestview.association.co_occurrence import MINIMUM_FRAME_SCORE
from bestview.association.index_ranges import expand_counts
from bestview.association.settings import ResolvedIdentitySettings
from bestview.association.tracklet import TrackletKey

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_MINIMUM_COMMON_FRAMES = 3
"""Frames in which both must be seen before their positions count."""
SCORED_S = 0.2
"""Seconds between two updates for which an appearance score counts once."""
_MAXIMUM_SCORED_S = 1.0
"""Seconds for which a score counts at most: people may have left in between."""
_EXTRA_LOCALIZED_FRAMES = 256
"""Frames kept beyond those within which people take part in clustering."""

RowKey = TrackletKey | int
"""An active tracklet, or the id of a person with settled tracklets."""


class AffinityMatrix:
    """Symmetric tables of evidence and constraints over N rows.

    Args:
        settings: of identity.
    """

    def __init__(self, settings: ResolvedIdentitySettings) -> None:
        self._ground_cap, self._memory_s, self._appearance_cap = (
            settings.maximum_ground_evidence,
            settings.cross_camera_memory_s,
            settings.maximum_cross_camera_evidence,
        )
        self._frames = settings.ground_correlation_frames
        self._row_of: dict[RowKey, int] = {}
        # Number of each row in the tables, never reused.
        self._row_names: Ints = np.zeros(0, dtype=np.int64)
        self._name_count = 0
        self._localized_frames = LocalizedFrames(settings.comparable_frames + _EXTRA_LOCALIZED_FRAMES)
        # Common frames at different places after which the evidence is capped.
        self._max_common_frames = max(
            _MINIMUM_COMMON_FRAMES,
            math.ceil(
                settings.maximum_ground_evidence * settings.ground_correlation_frames / -MINIMUM_FRAME_SCORE
            ),
        )
        self._cannot_link = SparsePairTable()
        self._appearance = SparsePairTable()
        # Ground evidence and common frames, both capped.
        self._ground = SparsePairTable(2)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self._row_of)

    @property
    def entry_count(self) -> int:
        """Number of pairs with an entry in some table."""
        return len(self._cannot_link) + len(self._appearance) + len(self._ground)

    def set_rows(self, rows: Sequence[RowKey]) -> None:
        """Replace the rows; those that were present keep their entries."""
        if rows == list(self._row_of):
            return
        old = np.array([self._row_of.get(row, -1) for row in rows], dtype=np.int64)
        self._localized_frames.set_rows(old)
        new = old < 0
        name = np.where(new, 0, self._row_names[old] if self._row_names.size else 0)
        name[new] = self._name_count + np.arange(int(new.sum()))
        self._name_count += int(new.sum())
        removed = np.setdiff1d(self._row_names, name)
        self._row_names = name
        self._row_of = {row: i for i, row in enumerate(rows)}
        if removed.size:
            for table in (self._cannot_link, self._appearance, self._ground):
                table.keep(~(np.isin(table.first, removed) | np.isin(table.second, removed)))

    def add_rows(self, rows: Iterable[RowKey]) -> None:
        """Append those of these rows that are missing, without evidence."""
        new = [row for row in dict.fromkeys(rows) if row not in self._row_of]
        self.set_rows([*self._row_of, *new])

    def rename_people(self, ids: Mapping[int, int]) -> None:
        """Replace the ids of people's rows, one to one; their evidence stays."""
        self._row_of = {
            ids.get(row, row) if isinstance(row, int) else row: i for row, i in self._row_of.items()
        }

    def add_cannot_links(self, first: Ints, second: Ints) -> None:
        """Add a cannot-link between (P,) pairs of rows that were seen simultaneously in one camera."""
        first, second = self._names_of(first, second)
        new = self._cannot_link.find(first, second) < 0
        first, second = unique_pairs(first[new], second[new])
        self._cannot_link.set(first, second, np.ones((first.size, 1)))

    def forbid_merging(self, first: Sequence[RowKey], second: Sequence[RowKey]) -> None:
        """Add cannot-links between every row of `first` and every row of `second`."""
        rows = [[self._row_of[key] for key in side if key in self._row_of] for side in (first, second)]
        first_rows, second_rows = np.meshgrid(*(np.array(side, dtype=np.int64) for side in rows))
        self.add_cannot_links(first_rows.ravel(), second_rows.ravel())

    def cannot_link(self, first: Ints, second: Ints) -> NDArray[np.bool_]:
        """Return for (P,) pairs of rows whether they have a cannot-link."""
        return self._cannot_link.find(*self._names_of(first, second)) >= 0

    def any_cannot_link(self, first: Sequence[int], second: Sequence[int]) -> bool:
        """Return whether any row of `first` has a cannot-link to any row of `second`."""
        first_rows, second_rows = np.meshgrid(
            np.array(first, dtype=np.int64), np.array(second, dtype=np.int64)
        )
        return bool(self.cannot_link(first_rows.ravel(), second_rows.ravel()).any())

    def proximity_pairs(self) -> tuple[Ints, Ints]:
        """Return the pairs of rows with ground evidence, the lower row first: (P,) and (P,)."""
        first, second = self._rows_of(self._ground.first), self._rows_of(self._ground.second)
        return np.minimum(first, second), np.maximum(first, second)

    def ground_evidence(self, first: Ints, second: Ints) -> Floats:
        """Return the evidence of (P,) pairs of rows from their ground positions: (P,)."""
        evidence, common = self._ground_entries(*self._names_of(first, second), first, second).T
        return np.asarray(np.where(common >= _MINIMUM_COMMON_FRAMES, evidence, 0.0))

    def add_ground_evidence(self, first: Ints, second: Ints, score: Floats, frames: Ints) -> None:
        """Add ground scores of some frames to (P,) pairs of rows.

        The sum stays within the cap, so that later frames can reverse earlier ones. `add_localized_frames`
        must follow for the same frames.
        """
        pair, index = np.unique(
            np.minimum(first, second) * len(self) + np.maximum(first, second), return_inverse=True
        )
        first, second = pair // max(len(self), 1), pair % max(len(self), 1)
        first_name, second_name = self._names_of(first, second)
        known = self._ground_entries(first_name, second_name, first, second)
        np.add.at(known[:, 0], index, score / self._frames)
        np.add.at(known[:, 1], index, frames)
        known[:, 0] = np.clip(known[:, 0], -self._ground_cap, self._ground_cap)
        known[:, 1] = np.minimum(known[:, 1], _MINIMUM_COMMON_FRAMES)
        self._ground.set(first_name, second_name, known)

    def add_localized_frames(self, row: Ints, frame: Ints) -> None:
        """Mark (P,) rows as localized in (P,) frames.

        Rows without ground evidence were at different places in common frames.
        """
        self._localized_frames.add(row, frame)
        # A pair at the lower cap needs no entry if its default evidence is at the cap too.
        capped = np.flatnonzero(self._ground.values[:, 0] <= -self._ground_cap)
        first, second = self._rows_of(self._ground.first[capped]), self._rows_of(self._ground.second[capped])
        keep = np.ones(len(self._ground), dtype=np.bool_)
        keep[capped] = self._default_ground_entries(first, second)[:, 0] > -self._ground_cap
        self._ground.keep(keep)

    def appearance_evidence(self, first: Ints, second: Ints) -> Floats:
        """Return the cross-camera appearance evidence of (P,) pairs of rows: (P,)."""
        return self._appearance.get(*self._names_of(first, second))[:, 0]

    def appearance_pairs(self) -> tuple[Ints, Ints]:
        """Return pairs of rows with cross-camera appearance evidence, lower first: (P,) and (P,)."""
        first, second = self._rows_of(self._appearance.first), self._rows_of(self._appearance.second)
        return np.minimum(first, second), np.maximum(first, second)

    def add_appearance_evidence(
        self, first: Ints, second: Ints, score: Floats, elapsed_s: float = SCORED_S
    ) -> None:
        """Add an update's appearance scores of (P,) pairs of rows, each pair once.

        Earlier evidence fades with the seconds since the last update, `elapsed_s`; the scores stand for them.
        """
        elapsed_s = min(elapsed_s, _MAXIMUM_SCORED_S)
        memory, score = max(1.0 - elapsed_s / self._memory_s, 0.0), score * (elapsed_s / SCORED_S)
        first, second = self._names_of(first, second)
        known = self._appearance.get(first, second)[:, 0]
        value = np.clip(memory * known + score, -self._appearance_cap, self._appearance_cap)
        self._appearance.set(first, second, value[:, None])
        self._appearance.keep(self._appearance.values[:, 0] != 0)

    def merge(self, pairs: Sequence[tuple[RowKey, RowKey]]) -> None:
        """Add the evidence of rows to others: both are one person.

        Args:
            pairs: kept row and lost row; no row is both.
        """
        pairs = [(kept, lost) for kept, lost in pairs if lost in self._row_of]
        if not pairs:
            return
        kept, lost = (
            np.array([self._row_of[pair[side]] for pair in pairs], dtype=np.int64) for side in (0, 1)
        )
        into = np.arange(len(self))
        into[lost] = kept
        self._merge_ground_evidence(into)
        self._localized_frames.merge(kept, lost)
        self._cannot_link, self._appearance = (
            table.relabeled(
                *(self._row_names[into[self._rows_of(side)]] for side in (table.first, table.second))
            )
            for table in (self._cannot_link, self._appearance)
        )

    def _merge_ground_evidence(self, into: Ints) -> None:
        """Sum the ground evidence of merged rows; `into` (N,) is the row that each goes into."""
        # The rows merged into each row, itself included.
        order = np.argsort(into, kind="stable")
        begin, end = (
            np.searchsorted(into[order], np.arange(into.size), side=side) for side in ("left", "right")
        )
        size = end - begin
        first, second = into[self._rows_of(self._ground.first)], into[self._rows_of(self._ground.second)]
        touched = (size[first] > 1) | (size[second] > 1)
        first, second = unique_pairs(first[touched], second[touched])
        different = first != second
        first, second = first[different], second[different]
        # Pairs of merged rows without an entry were at different places: their default evidence counts.
        pair, which = expand_counts(size[first] * size[second])
        first_row = order[begin[first][pair] + which // size[second][pair]]
        second_row = order[begin[second][pair] + which % size[second][pair]]
        known = self._ground_entries(*self._names_of(first_row, second_row), first_row, second_row)
        total = np.bincount(pair, known[:, 0], first.size)
        common = np.zeros(first.size)
        np.maximum.at(common, pair, known[:, 1])
        self._ground.keep(~touched)
        self._ground.set(*self._names_of(first, second), np.stack([total, common], axis=1))

    def _ground_entries(self, first_name: Ints, second_name: Ints, first: Ints, second: Ints) -> Floats:
        """Return ground evidence and common frames of (P,) pairs, given by names and by rows: (P, 2)."""
        index = self._ground.find(first_name, second_name)
        known = np.empty((index.size, 2))
        present = index >= 0
        known[present] = self._ground.values[index[present]]
        known[~present] = self._default_ground_entries(first[~present], second[~present])
        return known

    def _default_ground_entries(self, first: Ints, second: Ints) -> Floats:
        """Return ground evidence and common frames of (P,) pairs of rows that never came close: (P, 2)."""
        common = self._localized_frames.count_common_frames(first, second, self._max_common_frames).astype(
            np.float64
        )
        evidence = np.maximum(MINIMUM_FRAME_SCORE * common / self._frames, -self._ground_cap)
        return np.stack([evidence, np.minimum(common, _MINIMUM_COMMON_FRAMES)], axis=1)

    def _names_of(self, one: Ints, two: Ints) -> tuple[Ints, Ints]:
        return self._row_names[one], self._row_names[two]

    def _rows_of(self, names: Ints) -> Ints:
        order = np.argsort(self._row_names)
        return order[np.searchsorted(self._row_names, names, sorter=order)]
