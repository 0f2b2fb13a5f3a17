"""Times in frames: settings are in seconds, and become numbers of frames where the frame rate is known."""

from __future__ import annotations

DEFAULT_FPS = 25.0
"""Frames per second where none are given."""


def frames_in(seconds: float, fps: float, least: int = 1) -> int:
    """Return the number of frames in a time, at least `least`."""
    return max(round(seconds * fps), least)
