"""Corrections of published person ids: merges and splits."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from bestview.association.keys import TrackletKey


@dataclass(frozen=True, slots=True, order=True)
class Merge:
    """Two ids turned out to be one person: `lost` is never used again."""

    kept: int
    lost: int


@dataclass(frozen=True, slots=True, order=True)
class Split:
    """A track that a camera showed as `kept` turned out to be `split_off`, somebody else.

    `kept` is not necessarily seen any more: if two people exchanged their tracks, there are two splits.
    """

    kept: int
    split_off: int
    camera: str


class IdCorrections:
    """Keeps the last published id of every tracklet to detect splits."""

    def __init__(self) -> None:
        self._last: dict[TrackletKey, int] = {}

    def update(self, person_ids: Mapping[TrackletKey, int], merged: Sequence[Merge]) -> tuple[Split, ...]:
        """Compare the ids of the visible tracklets with their last ones; a merge is no split.

        A tracklet without an id, whose new person is not confirmed yet, is compared once it has one.
        """
        for merge in merged:
            self._last = {
                key: merge.kept if person_id == merge.lost else person_id
                for key, person_id in self._last.items()
            }
        splits = {
            Split(self._last[key], person_id, key.camera)
            for key, person_id in person_ids.items()
            if self._last.get(key, person_id) != person_id
        }
        self._last.update(person_ids)
        return tuple(sorted(splits))

    def split_off(self, keys: Iterable[TrackletKey], person_id: int) -> None:
        """Take over ids that an operator assigned: they are no splits to report."""
        self._last.update((key, person_id) for key in keys if key in self._last)

    def reassign_each(self, changed: Mapping[TrackletKey, tuple[int, int]]) -> None:
        """Take over ids that an operator assigned, given with the ids before and after."""
        for key, (_, person_id) in changed.items():
            self.split_off([key], person_id)

    def keep_only(self, keys: Collection[TrackletKey]) -> None:
        """Forget all other tracklets."""
        self._last = {key: person_id for key, person_id in self._last.items() if key in keys}
