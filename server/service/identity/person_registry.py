"""The registry of people by number: when they were seen, their names, and merged numbers."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

from server.service.identity.track_parts import UNCONFIRMED, TrackPart


class PersonRegistry:
    """All people who have a number, from their first frame until they are forgotten.

    Args:
        max_merged: limit of the merged numbers to keep; the newest are kept.
    """

    def __init__(self, max_merged: int) -> None:
        self._max_merged = max_merged
        self.first_seen: dict[int, int] = {}
        """By number, the first frame that shows the person; its keys are all known people."""
        self.last_seen: dict[int, int] = {}
        self.departed: set[int] = set()
        """People whom no camera has seen for a while."""
        self.merged: dict[int, int] = {}
        """By merged number: the number that was kept."""
        self.names: dict[int, str] = {}
        """Names given by the operator."""

    @property
    def all_numbers(self) -> list[int]:
        """All people's numbers, in order."""
        return sorted(self.first_seen)

    def current(self, number: int) -> int:
        """Return the current number of a merged one, or the number itself."""
        return self.merged.get(number, number)

    def aliases(self, number: int) -> list[int]:
        """Return the numbers that were merged into this one, in order."""
        return sorted(old for old, new in self.merged.items() if new == number)

    def record_visible(self, parts: Sequence[TrackPart], first: int, last: int) -> None:
        """Record that a track was visible between two frames, for the person of each of its parts."""
        for index, part in enumerate(parts):
            ends = last if index + 1 == len(parts) else min(last, parts[index + 1].first - 1)
            if part.number != UNCONFIRMED and max(first, part.first) <= ends:
                # A person exists from the start of the part: frames not decided yet can still show them.
                self.first_seen[part.number] = min(part.first, self.first_seen.get(part.number, part.first))
                self.last_seen[part.number] = max(ends, self.last_seen.get(part.number, ends))

    def update_presence(self, departed: Iterable[int], returned: Iterable[int]) -> None:
        """Record people who departed and who returned."""
        self.departed = (self.departed | set(departed)) - set(returned)

    def set_name(self, number: int, name: str) -> None:
        """Set a person's name; an empty one removes it."""
        self.names.pop(number, None)
        if name:
            self.names[number] = name

    def add_aliases(self, number: int, aliases: Iterable[int]) -> None:
        """Restore from an earlier run that these numbers were merged into a person's."""
        self.merged |= {old: number for old in aliases if old != number and old not in self.first_seen}

    def merge(self, kept: int, lost: int) -> None:
        """Merge two people: the union of the frames that show them, and the name that either had."""
        merged = {old: kept if new == lost else new for old, new in self.merged.items()} | {lost: kept}
        self.merged = dict(list(merged.items())[-self._max_merged :] if self._max_merged else [])
        name = self.names.pop(lost, "")
        if name:
            self.names.setdefault(kept, name)
        first, last = self.first_seen.pop(lost, None), self.last_seen.pop(lost, None)
        self.departed.discard(lost)
        if first is not None and last is not None:
            self.first_seen[kept] = min(first, self.first_seen.get(kept, first))
            self.last_seen[kept] = max(last, self.last_seen.get(kept, last))

    def renumber(self, numbers: Mapping[int, int]) -> None:
        """Replace people's numbers by others, one to one."""

        def new(number: int) -> int:
            return numbers.get(number, number)

        self.first_seen = {new(number): frame for number, frame in self.first_seen.items()}
        self.last_seen = {new(number): frame for number, frame in self.last_seen.items()}
        self.names = {new(number): name for number, name in self.names.items()}
        self.departed = set(map(new, self.departed))
        merged = {old: new(number) for old, number in self.merged.items() if old not in numbers.values()}
        gone = {old: number for old, number in numbers.items() if old not in numbers.values()}
        self.merged = dict(list((merged | gone).items())[-self._max_merged :] if self._max_merged else [])

    def restore(self, number: int, first_seen: int, last_seen: int, *, departed: bool) -> None:
        """Add a person whom another service knows."""
        self.first_seen.setdefault(number, first_seen)
        self.last_seen.setdefault(number, last_seen)
        if departed:
            self.departed.add(number)

    def forget(self, numbers: Collection[int]) -> None:
        """Forget people, their names, and the numbers that were merged into theirs."""
        for number in numbers:
            self.first_seen.pop(number, None)
            self.last_seen.pop(number, None)
            self.names.pop(number, None)
            self.departed.discard(number)
        self.merged = {
            old: new for old, new in self.merged.items() if old not in numbers and new not in numbers
        }

    def forget_unseen_since(self, frame: int) -> None:
        """Forget people who were last seen before this frame."""
        for number in [number for number, last in self.last_seen.items() if last < frame]:
            del self.first_seen[number], self.last_seen[number]
            self.departed.discard(number)
            self.names.pop(number, None)
            self.merged = {old: new for old, new in self.merged.items() if new != number}
