"""When a recording's pictures are shown on the site's clock, and how many there are a second."""

from __future__ import annotations

import math

from av.video.stream import VideoStream

DEFAULT_FPS = 25.0
"""Pictures a second of what does not say."""
_NEARLY = 0.05
"""Part by which the mean rate may be off a usual one that pictures are spaced by: some are missing."""
_USUAL_DENOMINATORS = (1, 2, 1001)
"""Of usual rates: 25, 12.5, 30000/1001."""
_LATE = 0.45
"""Part of a frame by which a picture may come after its pulse: what files say of times is rounded."""


def frame_rate(stream: VideoStream) -> float:
    """Return pictures a second: the usual rate that they are spaced by, else their mean."""
    mean, spaced = stream.average_rate, stream.guessed_rate
    if not mean:
        return float(spaced) if spaced else DEFAULT_FPS
    if not spaced or spaced.denominator not in _USUAL_DENOMINATORS or abs(mean / spaced - 1) > _NEARLY:
        return float(mean)
    return float(spaced)


def frame_index(seconds: float, fps: float) -> int:
    """Return the first frame of a clock that shows a picture of so many seconds after the first one."""
    return math.ceil(seconds * fps - _LATE)


def frame_count(seconds: float, rate: float, fps: float) -> int:
    """Return the frames of a clock that a recording lasts whose last picture is at ``seconds``."""
    return max(1, frame_index(seconds + 1 / rate, fps))
