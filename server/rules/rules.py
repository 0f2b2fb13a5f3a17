"""Rules about people and zones, and the events that they raise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from server.rules.schedule import Schedule


class RuleKind(StrEnum):
    """What a rule waits for."""

    ENTERED = "entered"
    LEFT = "left"
    CROSSED = "crossed"
    STAYED = "stayed"
    CROWDED = "crowded"
    CLOSE = "close"


class Direction(StrEnum):
    """Over a line: to its inner side, or away from it."""

    INWARD = "inward"
    OUTWARD = "outward"


class Phase(StrEnum):
    """Part of an event: someone enters once; a crowd begins and ends."""

    ONCE = "once"
    BEGAN = "began"
    ENDED = "ended"


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule. Times are frames; distances those of the zones on the floor.

    Attributes:
        name: its id.
        kind: what it waits for.
        zone: the name of its zone; None: anywhere.
        people: numbers and names of those it is about; empty: everybody. Of two who are close, one.
        schedule: when it applies; None: always.
        cameras: it applies while all of these send clear pictures.
        direction: over a line; None: both.
        longer_than: frames of staying.
        more_than: number of people.
        closer_than: distance of two people on the floor.
        margin: distance beyond ``closer_than`` at which they are apart again.
        hold: frames for which more people, or fewer, or closer ones, must be there.
    """

    name: str
    kind: RuleKind
    zone: str | None = None
    people: frozenset[int | str] = frozenset()
    schedule: Schedule | None = None
    cameras: frozenset[str] = frozenset()
    direction: Direction | None = None
    longer_than: int = 0
    more_than: int = 0
    closer_than: float = 0.0
    margin: float = 0.0
    hold: int = 0

    def is_about(self, person: int, names: Mapping[int, str]) -> bool:
        """Return whether a person is one that the rule is about; ``names`` of people by number."""
        return not self.people or person in self.people or names.get(person) in self.people

    def applies(self, moment: float | None, clear: frozenset[str]) -> bool:
        """Return whether the rule applies.

        At a moment, unix seconds; None: unknown, so that no schedule includes it. ``clear``: the cameras that
        send clear pictures.
        """
        if not self.cameras <= clear:
            return False
        return self.schedule is None or (moment is not None and self.schedule.includes(moment))


@dataclass(frozen=True, slots=True)
class RuleEvent:
    """What a rule has found.

    Attributes:
        rule: its name.
        kind: its kind.
        phase: whether this is the beginning or the end of what lasts.
        pulse: when it happened: the frame of the step over the border.
        confirmed: the frame in which it had lasted long enough to count.
        zone: the rule's zone, or None.
        people: numbers of those concerned, in order.
        direction: over a line, else None.
    """

    rule: str
    kind: RuleKind
    phase: Phase
    pulse: int
    confirmed: int
    zone: str | None
    people: tuple[int, ...]
    direction: Direction | None = None
