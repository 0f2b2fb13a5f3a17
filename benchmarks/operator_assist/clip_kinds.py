"""What an operator can help with in the benchmark: how its clips are made, and how they are tracked."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

from benchmarks.operator_assist.assisted_tracking import FISH, PLAYERS, TrackingSetup
from benchmarks.operator_assist.clips import Clip
from benchmarks.operator_assist.drawn_clips import ClipScene, drawn
from benchmarks.operator_assist.fish_school import school


@dataclass(frozen=True, slots=True)
class ClipKind:
    """One kind of clips.

    Attributes:
        make: gives the clip of a seed.
        setup: how it is tracked.
    """

    make: Callable[[int], Clip]
    setup: TrackingSetup

    def clips(self, count: int, first: int) -> Iterator[Clip]:
        """Return so many clips, of every second seed from `first` on."""
        return (self.make(first + 2 * number) for number in range(count))


def kinds(objects: int | None = None, seconds: float = 20.0) -> dict[str, ClipKind]:
    """Return the kinds by name; `objects`: how many fish or players there are, if not as usual."""
    fish = ClipScene("fish", objects or 9, seconds)
    court = ClipScene("court", objects or 10, seconds, fps=25.0, size=(640, 360), people=True)
    return {
        "school": ClipKind(partial(school, fish=objects or 9, seconds=seconds), FISH),
        "fish": ClipKind(partial(drawn, fish), FISH),
        "court": ClipKind(partial(drawn, court), PLAYERS),
    }
