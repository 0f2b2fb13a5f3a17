"""The measured delay of each of the delays that viewers may choose."""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from server.service.streaming.frame_buffer import FrameBuffer
from server.service.view_selection.delay_modes import DelayMode, ModeDecision

_WINDOW_S = 60.0
"""Seconds over which delays are measured."""
_MAX_SAMPLES = 4096
_PERCENTILES = 20
"""The last of these quantiles is the 95th percentile."""


@dataclass(frozen=True, slots=True)
class MeasuredDelay:
    """Seconds from when a frame was due until it could be sent, in the last minute.

    Attributes:
        median: half of them took less.
        p95: 95 % of them took less.
    """

    median: float
    p95: float


class DelayMeter:
    """Measures from a frame's pulse until it can be sent: of a GOP's first frame, or, live, of every frame.

    ``seconds_since`` returns the seconds since a pulse was due; None: not known yet.
    """

    def __init__(
        self, seconds_since: Callable[[int], float | None], buffers: Iterable[FrameBuffer], fps: float
    ) -> None:
        self._seconds_since, self._buffers, self._fps = seconds_since, tuple(buffers), fps
        self._samples: dict[DelayMode, deque[tuple[int, float]]] = {
            mode: deque(maxlen=_MAX_SAMPLES) for mode in DelayMode
        }
        self._live_end = 0
        """The first pulse without a live decision."""

    def measure_decision(self, mode: DelayMode, first: int) -> None:
        """Measure a GOP that is about to be sent whole."""
        self._measure(mode, first)

    def measure_live_decision(self, decision: ModeDecision) -> None:
        """Measure the frames that were waiting for their decision."""
        self._live_end = decision.first + decision.frames
        for buffer in self._buffers:
            for pulse in range(decision.first, min(buffer.newest + 1, self._live_end)):
                if buffer.has(pulse):
                    self._measure(DelayMode.LIVE, pulse)

    def measure_arrival(self, pulse: int) -> None:
        """Measure a frame that has arrived."""
        if pulse < self._live_end:
            self._measure(DelayMode.LIVE, pulse)

    def delay(self, mode: DelayMode) -> MeasuredDelay | None:
        """Return the delay in the last minute; None: nothing was measured."""
        samples = self._samples[mode]
        newest = samples[-1][0] if samples else 0
        recent = [seconds for pulse, seconds in samples if pulse > newest - _WINDOW_S * self._fps]
        if not recent:
            return None
        if len(recent) == 1:
            return MeasuredDelay(recent[0], recent[0])
        return MeasuredDelay(
            statistics.median(recent), statistics.quantiles(recent, n=_PERCENTILES, method="inclusive")[-1]
        )

    def _measure(self, mode: DelayMode, pulse: int) -> None:
        seconds = self._seconds_since(pulse)
        if seconds is not None:
            self._samples[mode].append((pulse, max(seconds, 0.0)))
