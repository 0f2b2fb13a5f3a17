"""Proposals of a site's picture size and frame rate from what its cameras send."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from server.config.sections import SiteSettings
from server.setup.trial_messages import StreamTrial

_MOST = (1280, 720)
"""Largest proposed size: people are searched in smaller pictures anyway, and each camera is encoded."""
_MAX_FPS = 25.0
_LEAST_SIDE = 16


@dataclass(frozen=True, slots=True)
class SiteProposal:
    """Settings of the section `site`: frames per second, width and height in pixels."""

    fps: float
    width: int
    height: int


def propose_site(trials: Sequence[StreamTrial]) -> SiteProposal:
    """Propose the smallest camera's size, at most 1280x720, so that none is enlarged, and the median rate.

    A slower camera then repeats pictures, a faster one skips some. Without trials: the defaults.
    """
    if not trials:
        defaults = SiteSettings()
        return SiteProposal(defaults.fps, defaults.width, defaults.height)
    smallest = min(trials, key=lambda trial: trial.width * trial.height)
    scale = min(1.0, _MOST[0] / max(1, smallest.width), _MOST[1] / max(1, smallest.height))
    rates = [trial.fps for trial in trials if trial.fps > 0]
    fps = min(_MAX_FPS, statistics.median_low(rates)) if rates else _MAX_FPS
    return SiteProposal(fps, _even(smallest.width * scale), _even(smallest.height * scale))


def _even(side: float) -> int:
    """Round down to an even number: H.264 stores color at half the size."""
    return max(_LEAST_SIDE, 2 * math.floor((side + 1e-6) / 2))
