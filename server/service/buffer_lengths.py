"""How long the best-view service keeps frames, and waits for cameras."""

from __future__ import annotations

from dataclasses import dataclass

from server.config.site_config import Config

_MAX_AHEAD_S = 60.0
"""Seconds that a camera's pulses may be ahead of this service's, which may have been suspended."""
_SEARCH_S = 1.0
"""Seconds from the search of a frame that has waited as long as it may until its tracks arrive."""


@dataclass(frozen=True, slots=True)
class BufferLengths:
    """Lengths in frames.

    Attributes:
        frames: that are buffered of each camera.
        grace: that are waited for a connected camera's tracks.
        backlog: that cameras on a busy machine may be behind.
        max_ahead: that a camera's pulses may be ahead.
        max_lookahead: the longest look-ahead that can be set at run time: half of what the buffers allow.
    """

    frames: int
    grace: int
    backlog: int
    max_ahead: int
    max_lookahead: int

    @classmethod
    def of(cls, config: Config) -> BufferLengths:
        """Compute them: frames are buffered until the last camera that is waited for has reported."""
        fps, stride = config.site.fps, config.window.stride
        grace = round(config.view.late_after_s * fps)
        backlog = round((config.track.backlog_s + _SEARCH_S) * fps)
        smooth = round(config.view.smooth_lookahead_s * fps) + config.gop
        frames = max(
            round(config.view.buffer_s * fps),
            backlog + 4 * (config.lookahead + grace + stride),
            backlog + 2 * (grace + stride) + smooth,
        )
        max_lookahead = (frames - backlog) // 2 - grace - stride
        return cls(frames, grace, backlog, round(_MAX_AHEAD_S * fps), max_lookahead)
