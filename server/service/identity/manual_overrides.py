"""Manual merges of person numbers, applied on top of the automatic association.

The association continues unchanged, and its numbers are mapped here. So a manual merge holds regardless of
the evidence, and to the page, the streams and the files it is like any other merge.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

from bestview import IdentityUpdate, Merge, Split


def numbers_of_correction(correction: Merge | Split) -> tuple[int, int]:
    """Return the two people that a correction is about."""
    if isinstance(correction, Merge):
        return correction.kept, correction.lost
    return correction.published_id, correction.corrected_id


class ManualOverrides:
    """Numbers that an operator has merged."""

    def __init__(self) -> None:
        self._person_of: dict[int, int] = {}
        """By automatic number: the number it was merged into."""
        self._departed: set[int] = set()
        """The numbers involved in manual merges that the association considers departed."""

    @property
    def merged(self) -> dict[int, int]:
        """Return the manual merges: by merged number, the number that was kept."""
        return dict(sorted(self._person_of.items()))

    def current(self, number: int) -> int:
        """Return the current number of this one."""
        return self._person_of.get(number, number)

    def automatic_numbers(self, number: int) -> list[int]:
        """Return the automatic numbers behind a number, in order."""
        return sorted({number, *(raw for raw, kept in self._person_of.items() if kept == number)})

    def merge(self, kept: int, lost: int, departed: Collection[int] = ()) -> None:
        """Merge two numbers into one person; `departed` are the departed people."""
        self._departed |= {
            number for number in (kept, lost) if number in departed and number not in self._involved
        }
        for raw in self.automatic_numbers(lost):
            self._person_of[raw] = kept

    def renumber(self, numbers: Mapping[int, int]) -> None:
        """Replace numbers by others, one to one."""
        self._person_of = {
            numbers.get(raw, raw): numbers.get(kept, kept) for raw, kept in self._person_of.items()
        }
        self._departed = {numbers.get(number, number) for number in self._departed}

    def forget(self, numbers: Collection[int]) -> None:
        """Forget numbers, and what was merged into them."""
        self._person_of = {
            raw: kept for raw, kept in self._person_of.items() if raw not in numbers and kept not in numbers
        }
        self._departed -= set(numbers)

    def apply(self, update: IdentityUpdate) -> IdentityUpdate:
        """Return an update with all numbers mapped by the manual merges."""
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
                number
                for number in self._people(update.departed)
                if self._departed.issuperset(self.automatic_numbers(number))
            ),
            merged=merged,
            split=self.map_splits(update.split),
        )

    def map_splits(self, splits: Iterable[Split]) -> tuple[Split, ...]:
        """Return splits with mapped numbers; a split within one manually merged person is dropped."""
        mapped = {
            Split(self.current(split.published_id), self.current(split.corrected_id), split.camera)
            for split in splits
        }
        return tuple(sorted(split for split in mapped if split.published_id != split.corrected_id))

    @property
    def _involved(self) -> set[int]:
        return {*self._person_of, *self._person_of.values()}

    def _merged(self, merged: Iterable[Merge]) -> Iterable[Merge]:
        """Yield merges with mapped numbers; they extend the manual merges they touch."""
        for merge in merged:
            self._departed.discard(merge.lost)
            kept, lost = self.current(merge.kept), self.current(merge.lost)
            if kept != lost:
                if lost in self._involved:
                    self.merge(kept, lost)
                yield Merge(kept, lost)

    def _people(self, numbers: Iterable[int]) -> tuple[int, ...]:
        return tuple(sorted({self.current(number) for number in numbers}))
