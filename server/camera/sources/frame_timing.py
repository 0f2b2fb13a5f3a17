"""Frame rate of a recording, and the mapping of frame times to pulses."""

from __future__ import annotations

import math

from av.video.stream import VideoStream

DEFAULT_FPS = 25.0
"""Frames per second where the file does not declare a rate."""
_NEARLY = 0.05
"""Relative deviation of the mean rate from a usual one, due to missing frames."""
_USUAL_DENOMINATORS = (1, 2, 1001)
"""Denominators of usual rates: 25, 12.5, 30000/1001."""
_LATE = 0.45
"""Share of a frame interval by which a frame may be later than its pulse: times in files are rounded."""


def frame_rate(stream: VideoStream) -> float:
    """Return frames per second: the usual rate that fits their spacing, else the mean rate."""
    mean, spaced = stream.average_rate, stream.guessed_rate
    if not mean:
        return float(spaced) if spaced else DEFAULT_FPS
    if not spaced or spaced.denominator not in _USUAL_DENOMINATORS or abs(mean / spaced - 1) > _NEARLY:
        return float(mean)
    return float(spaced)


def frame_index(seconds: float, fps: float) -> int:
    """Return the index, at ``fps``, of a frame that is ``seconds`` after the first one."""
    return math.ceil(seconds * fps - _LATE)


def frame_count(last_frame_s: float, rate: float, fps: float) -> int:
    """Return a recording's length in frames at ``fps``; its last frame is at ``last_frame_s``."""
    return max(1, frame_index(last_frame_s + 1 / rate, fps))
