"""What turns out about numbers already given: two were one person, or one stood for two."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from bestview.association.keys import EpisodeKey


@dataclass(frozen=True, slots=True, order=True)
class Merge:
    """Two numbers turned out to be one person: `lost` is never used again."""

    kept: int
    lost: int


@dataclass(frozen=True, slots=True, order=True)
class Split:
    """Whom a camera showed as `kept` turned out to be `parted`, somebody else.

    `kept` is not necessarily seen any more: if two people exchanged their tracks, there are two splits.
    """

    kept: int
    parted: int
    camera: str


class Corrections:
    """Remembers the last number of every track, to tell when it stands for somebody else than before."""

    def __init__(self) -> None:
        self._last: dict[EpisodeKey, int] = {}

    def update(self, numbers: Mapping[EpisodeKey, int], merged: Sequence[Merge]) -> tuple[Split, ...]:
        """Compare the numbers of the tracks seen with their last ones; a merge is no split.

        A track that has no number for a while, until its new person is confirmed, is told when it has.
        """
        for merge in merged:
            self._last = {
                key: merge.kept if number == merge.lost else number for key, number in self._last.items()
            }
        splits = {
            Split(self._last[key], number, key.camera)
            for key, number in numbers.items()
            if self._last.get(key, number) != number
        }
        self._last.update(numbers)
        return tuple(sorted(splits))

    def part(self, keys: Iterable[EpisodeKey], number: int) -> None:
        """Take over that tracks are said to stand for somebody else: who said so knows."""
        self._last.update((key, number) for key in keys if key in self._last)

    def part_each(self, changed: Mapping[EpisodeKey, tuple[int, int]]) -> None:
        """Take over, with the numbers before and after, which parts are said to stand for somebody else."""
        for key, (_, number) in changed.items():
            self.part([key], number)

    def keep_only(self, keys: Collection[EpisodeKey]) -> None:
        """Forget all other tracks."""
        self._last = {key: number for key, number in self._last.items() if key in keys}
