"""The kinds of clips of the benchmark: their generators and tracker settings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

from benchmarks.operator_assist.assisted_tracking import FISH, PLAYERS, TrackingSetup
from benchmarks.operator_assist.clips import Clip
from benchmarks.operator_assist.drawn_clips import ClipScene, render_clip
from benchmarks.operator_assist.fish_school import simulate_school


@dataclass(frozen=True, slots=True)
class ClipKind:
    """A kind of clips.

    Attributes:
        make: returns the clip of a seed.
        setup: the settings that it is tracked with.
    """

    make: Callable[[int], Clip]
    setup: TrackingSetup

    def clips(self, count: int, first: int) -> Iterator[Clip]:
        """Return `count` clips, of every second seed from `first` on."""
        return (self.make(first + 2 * number) for number in range(count))


def kinds(objects: int | None = None, seconds: float = 20.0) -> dict[str, ClipKind]:
    """Return the kinds by name; `objects`: number of fish or players, by default nine or ten."""
    fish = ClipScene("fish", objects or 9, seconds)
    court = ClipScene("court", objects or 10, seconds, fps=25.0, size=(640, 360), people=True)
    return {
        "school": ClipKind(partial(simulate_school, fish=objects or 9, seconds=seconds), FISH),
        "fish": ClipKind(partial(render_clip, fish), FISH),
        "court": ClipKind(partial(render_clip, court), PLAYERS),
    }
