"""Times in frames: settings are in seconds, and become numbers of frames where the frame rate is known."""

from __future__ import annotations

import math

DEFAULT_FPS = 25.0
"""Frames per second where none are given."""


def frames_in(seconds: float, fps: float, least: int = 1) -> int:
    """Return the number of frames in a time, at least `least`."""
    return max(round(seconds * fps), least)


def seconds_up(frames: int, fps: float) -> float:
    """Return a time of so many frames in seconds, rounded up to a thousandth for people to read and enter."""
    return math.ceil(frames / fps * _THOUSANDTHS - _ROUNDING) / _THOUSANDTHS


_THOUSANDTHS = 1000
_ROUNDING = 1e-6
