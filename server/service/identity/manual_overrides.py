"""What somebody who knows them has said of people: who two numbers are one person, and what they are called.

It lies over what is worked out, which goes on as ever; here its numbers are read as what was said. So a merge
by hand holds whatever the evidence says, and the page, the streams and the files know it as any other merge.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace

from bestview import IdentityUpdate, Merge, Split


class ManualOverrides:
    """Numbers that an operator has merged, split or named."""

    def __init__(self) -> None:
        self._person_of: dict[int, int] = {}
        """By a number that is worked out: whose it is said to be."""
        self._departed: set[int] = set()
        """Of those numbers and whose they are said to be: who is worked out to be away."""

    @property
    def merged(self) -> dict[int, int]:
        """Return whose number each is said to be that is said to be another's."""
        return dict(sorted(self._person_of.items()))

    def current(self, number: int) -> int:
        """Return whose number this is."""
        return self._person_of.get(number, number)

    def automatic_numbers(self, number: int) -> list[int]:
        """Return the numbers that are worked out of somebody, in order."""
        return sorted({number, *(raw for raw, said in self._person_of.items() if said == number)})

    def merge(self, kept: int, lost: int, away: Collection[int] = ()) -> None:
        """Merge two numbers into one person; `away` names the absent one of numbers never merged."""
        self._departed |= {it for it in (kept, lost) if it in away and it not in self._involved}
        for raw in self.automatic_numbers(lost):
            self._person_of[raw] = kept

    def apply(self, update: IdentityUpdate) -> IdentityUpdate:
        """Read an update as what was said."""
        if not self._person_of:
            return update
        self._departed = ((self._departed | set(update.departed)) & self._involved) - set(update.returned)
        merged = tuple(self._merged(update.merged))
        return replace(
            update,
            person_ids={key: self.current(number) for key, number in update.person_ids.items()},
            created=tuple(number for number in update.created if number not in self._person_of),
            returned=self._people(update.returned),
            departed=tuple(
                it
                for it in self._people(update.departed)
                if self._departed.issuperset(self.automatic_numbers(it))
            ),
            merged=merged,
            split=self.apply_splits(update.split),
        )

    def apply_splits(self, splits: Iterable[Split]) -> tuple[Split, ...]:
        """Read splits as what was said: of two numbers that are said to be one person's there are none."""
        said = {Split(self.current(it.kept), self.current(it.split_off), it.camera) for it in splits}
        return tuple(sorted(it for it in said if it.kept != it.split_off))

    @property
    def _involved(self) -> set[int]:
        return {*self._person_of, *self._person_of.values()}

    def _merged(self, merged: Iterable[Merge]) -> Iterable[Merge]:
        """Read merges: whoever one of them is said to be, the other is, too."""
        for it in merged:
            self._departed.discard(it.lost)
            kept, lost = self.current(it.kept), self.current(it.lost)
            if kept != lost:
                if lost in self._involved:
                    self.merge(kept, lost)
                yield Merge(kept, lost)

    def _people(self, numbers: Iterable[int]) -> tuple[int, ...]:
        return tuple(sorted({self.current(number) for number in numbers}))
