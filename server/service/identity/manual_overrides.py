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
        self._is: dict[int, int] = {}
        """By a number that is worked out: whose it is said to be."""
        self._gone: set[int] = set()
        """Of those numbers and whose they are said to be: who is worked out to be away."""

    @property
    def said(self) -> dict[int, int]:
        """Return whose number each is said to be that is said to be another's."""
        return dict(sorted(self._is.items()))

    def now(self, number: int) -> int:
        """Return whose number this is."""
        return self._is.get(number, number)

    def worked_out(self, number: int) -> list[int]:
        """Return the numbers that are worked out of somebody, in order."""
        return sorted({number, *(raw for raw, said in self._is.items() if said == number)})

    def merge(self, kept: int, lost: int, away: Collection[int] = ()) -> None:
        """Merge two numbers into one person; `away` names the absent one of numbers never merged."""
        self._gone |= {it for it in (kept, lost) if it in away and it not in self._spoken_of}
        for raw in self.worked_out(lost):
            self._is[raw] = kept

    def read(self, update: IdentityUpdate) -> IdentityUpdate:
        """Read an update as what was said."""
        if not self._is:
            return update
        self._gone = ((self._gone | set(update.departed)) & self._spoken_of) - set(update.returned)
        merged = tuple(self._merged(update.merged))
        return replace(
            update,
            person_ids={key: self.now(number) for key, number in update.person_ids.items()},
            created=tuple(number for number in update.created if number not in self._is),
            returned=self._people(update.returned),
            departed=tuple(
                it for it in self._people(update.departed) if self._gone.issuperset(self.worked_out(it))
            ),
            merged=merged,
            split=self.read_splits(update.split),
        )

    def read_splits(self, splits: Iterable[Split]) -> tuple[Split, ...]:
        """Read splits as what was said: of two numbers that are said to be one person's there are none."""
        said = {Split(self.now(it.kept), self.now(it.split_off), it.camera) for it in splits}
        return tuple(sorted(it for it in said if it.kept != it.split_off))

    @property
    def _spoken_of(self) -> set[int]:
        return {*self._is, *self._is.values()}

    def _merged(self, merged: Iterable[Merge]) -> Iterable[Merge]:
        """Read merges: whoever one of them is said to be, the other is, too."""
        for it in merged:
            self._gone.discard(it.lost)
            kept, lost = self.now(it.kept), self.now(it.lost)
            if kept != lost:
                if lost in self._spoken_of:
                    self.merge(kept, lost)
                yield Merge(kept, lost)

    def _people(self, numbers: Iterable[int]) -> tuple[int, ...]:
        return tuple(sorted({self.now(number) for number in numbers}))
