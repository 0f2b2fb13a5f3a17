"""What the cameras saw of a walk, and how it is compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from bestview.calibration import Walk, WalkSettings

_MOMENT_S = 0.2
"""Seconds between the moments at which cameras are compared: people walk a sixth of their height."""


@dataclass(frozen=True, slots=True)
class Walked:
    """The cameras' walks, and how many frames there are in a second.

    `guessed` are cameras whose picture's size is only guessed, from the boxes; `rate_guessed` is whether the
    rate is only what is usual. `offsets` are by camera those that the frames have in them already; of those
    that are `live` none can be set.
    """

    walks: tuple[Walk, ...]
    fps: float
    guessed: tuple[str, ...] = ()
    rate_guessed: bool = False
    offsets: Mapping[str, int] = field(default_factory=dict)
    live: tuple[str, ...] = ()


def walk_settings(fps: float, shift: float) -> WalkSettings:
    """Give the settings for recordings of so many frames a second, out of step by `shift` seconds at most."""
    return WalkSettings(shift=round(shift * fps), step=moment(fps))


def moment(fps: float) -> int:
    """Give the frames between the moments at which cameras are compared."""
    return max(1, round(_MOMENT_S * fps))
