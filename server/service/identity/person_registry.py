"""Who there is, by number: when they were seen, what they are called, and which numbers were another's."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from server.service.identity.track_parts import NOBODY_YET, TrackPart


class PersonRegistry:
    """All people who have a number, from their first frame until they are forgotten.

    Args:
        most_merged: how many numbers that turned out to be another's are remembered, the newest.
    """

    def __init__(self, most_merged: int) -> None:
        self._most_merged = most_merged
        self.first_seen: dict[int, int] = {}
        """The first frame that shows somebody; whoever is in it has a number."""
        self.last_seen: dict[int, int] = {}
        self.away: set[int] = set()
        """Those whom no camera has seen for a while; they are remembered."""
        self.merged: dict[int, int] = {}
        """By a number that turned out to be another's: whose it is."""
        self.names: dict[int, str] = {}
        """What people are called; said by hand."""

    @property
    def everybody(self) -> list[int]:
        """Everybody's number, in order."""
        return sorted(self.first_seen)

    def current(self, number: int) -> int:
        """Return whose number this is: what it turned out to be, or itself."""
        return self.merged.get(number, number)

    def aliases(self, number: int) -> list[int]:
        """Return the other numbers that somebody once had, in order."""
        return sorted(old for old, new in self.merged.items() if new == number)

    def note(self, parts: Sequence[TrackPart], first: int, last: int) -> None:
        """Note that a track was seen from a frame to another, by whose it was in which part of them."""
        for place, part in enumerate(parts):
            ends = last if place + 1 == len(parts) else min(last, parts[place + 1].first - 1)
            if part.number != NOBODY_YET and max(first, part.first) <= ends:
                # Who is confirmed now was there before: frames that are not decided yet can still show them.
                self.first_seen[part.number] = min(part.first, self.first_seen.get(part.number, part.first))
                self.last_seen[part.number] = max(ends, self.last_seen.get(part.number, ends))

    def update_presence(self, gone: Iterable[int], returned: Iterable[int]) -> None:
        """Note who has gone away, and who is back."""
        self.away = (self.away | set(gone)) - set(returned)

    def set_name(self, number: int, name: str) -> None:
        """Set a person's name; an empty one removes it."""
        self.names.pop(number, None)
        if name:
            self.names[number] = name

    def add_aliases(self, number: int, also: Iterable[int]) -> None:
        """Take over from an earlier run that somebody had these numbers, too."""
        self.merged |= {old: number for old in also if old != number and old not in self.first_seen}

    def merge(self, kept: int, lost: int) -> None:
        """Make two people one, who was seen whenever either was, and keeps a name that either had."""
        merged = {old: kept if new == lost else new for old, new in self.merged.items()} | {lost: kept}
        self.merged = dict(list(merged.items())[-self._most_merged :] if self._most_merged else [])
        name = self.names.pop(lost, "")
        if name:
            self.names.setdefault(kept, name)
        first, last = self.first_seen.pop(lost, None), self.last_seen.pop(lost, None)
        self.away.discard(lost)
        if first is not None and last is not None:
            self.first_seen[kept] = min(first, self.first_seen.get(kept, first))
            self.last_seen[kept] = max(last, self.last_seen.get(kept, last))

    def forget_unseen_since(self, frame: int) -> None:
        """Let go of who was not seen from this frame on."""
        for number in [number for number, last in self.last_seen.items() if last < frame]:
            del self.first_seen[number], self.last_seen[number]
            self.away.discard(number)
            self.names.pop(number, None)
            self.merged = {old: new for old, new in self.merged.items() if new != number}
