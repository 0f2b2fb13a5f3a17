"""Frames that are left out on purpose: the tracker is given what was probably there."""

from __future__ import annotations

from collections.abc import Sequence

from tracking import Detections, WindowResult, interpolate_detections, merge_results
from tracking.detectors import Image
from tracking.interactive import InteractiveTracker, PositionCorrection
from tracking.registry import Tracker


class FrameSkipper:
    """Hands the frames of a camera to its tracker in order, and skips detection in some.

    A frame that is left out waits for the next one that is searched, which is at the latest the last one of
    its window: no window is late for it.
    """

    def __init__(self, tracker: Tracker, bins: int, stride: int) -> None:
        self._tracker, self._nothing, self._stride = tracker, Detections.empty(bins), stride
        self._held: list[int] = []
        self._before: tuple[int, Detections] | None = None
        """The last searched frame."""

    def leave_out(self, pulse: int) -> WindowResult | None:
        """Take in that a frame is left out. Pulses must grow."""
        self._held.append(pulse)
        # Its window must not wait for a frame that may never come.
        return self._release(None) if (pulse + 1) % self._stride == 0 else None

    def push(self, pulse: int, detections: Detections, image: Image | None = None) -> WindowResult | None:
        """Take in what was found in a frame."""
        results = [self._release((pulse, detections)), self._tracker.push(pulse, detections, image)]
        self._before = pulse, detections
        return merge_results([it for it in results if it is not None])

    def point(self, pointings: Sequence[PositionCorrection]) -> WindowResult | None:
        """Take in where somebody points; None: that changes nothing, or the tracker takes no pointings."""
        return (
            self._tracker.apply_corrections(pointings)
            if isinstance(self._tracker, InteractiveTracker)
            else None
        )

    def flush(self) -> WindowResult | None:
        """End the recording."""
        results = [self._release(None), self._tracker.flush()]
        return merge_results([it for it in results if it is not None])

    def _release(self, after: tuple[int, Detections] | None) -> WindowResult | None:
        """Return the tracker what waits; ``after`` is the next searched frame."""
        held, self._held = self._held, []
        results = [self._tracker.push(it, self._guessed(it, after)) for it in held]
        return merge_results([it for it in results if it is not None])

    def _guessed(self, pulse: int, after: tuple[int, Detections] | None) -> Detections:
        before = self._before
        if before is None or after is None or after[0] - before[0] > self._stride:
            return self._nothing
        return interpolate_detections(before[1], after[1], (pulse - before[0]) / (after[0] - before[0]))
