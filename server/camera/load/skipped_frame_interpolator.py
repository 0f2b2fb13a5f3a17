"""Skipped frames: the tracker receives detections interpolated from the frames around them."""

from __future__ import annotations

from collections.abc import Sequence

from tracking import Detections, WindowResult, interpolate_detections, merge_results
from tracking.detectors import Image
from tracking.interactive import CorrectableTracker, PositionCorrection
from tracking.registry import Tracker


class SkippedFrames:
    """Frames that wait for the next one with detection, from which theirs are interpolated.

    Between frames that are more than ``longest_gap`` apart none is interpolated.
    """

    def __init__(self, longest_gap: int) -> None:
        self._longest_gap = longest_gap
        self._skipped: list[int] = []
        self._before: tuple[int, Detections] | None = None
        """The last frame with detection."""

    def add(self, pulse: int) -> None:
        """Add a skipped frame. Pulses must ascend."""
        self._skipped.append(pulse)

    def take(self, after: tuple[int, Detections] | None) -> list[tuple[int, Detections | None]]:
        """Remove the frames, and return them with their detections; None: these cannot be interpolated.

        ``after`` is the next frame with detection, None if it is not waited for.
        """
        taken = [(pulse, self._interpolated(pulse, after)) for pulse in self._skipped]
        self._skipped = []
        self._before = self._before if after is None else after
        return taken

    def forget_until(self, pulse: int) -> None:
        """Remove the frames up to a pulse."""
        self._skipped = [skipped for skipped in self._skipped if skipped > pulse]

    def _interpolated(self, pulse: int, after: tuple[int, Detections] | None) -> Detections | None:
        before = self._before
        if before is None or after is None or after[0] - before[0] > self._longest_gap:
            return None
        return interpolate_detections(before[1], after[1], (pulse - before[0]) / (after[0] - before[0]))


class SkippedFrameInterpolator:
    """Passes frames to the tracker in order, with interpolated detections for skipped ones.

    A skipped frame waits for the next one with detection, at most until the end of its window.
    """

    def __init__(self, tracker: Tracker, bins: int, window_stride: int) -> None:
        self._tracker, self._no_detections = tracker, Detections.empty(bins)
        self._window_stride, self._skipped = window_stride, SkippedFrames(window_stride)

    def skip(self, pulse: int) -> WindowResult | None:
        """Skip a frame. Pulses must ascend."""
        self._skipped.add(pulse)
        # The window must not wait for the next frame, which may never come.
        return self._release(None) if (pulse + 1) % self._window_stride == 0 else None

    def push(self, pulse: int, detections: Detections, image: Image | None = None) -> WindowResult | None:
        """Push a frame's detections."""
        results = [self._release((pulse, detections)), self._tracker.push(pulse, detections, image)]
        return merge_results([result for result in results if result is not None])

    def apply_corrections(self, corrections: Sequence[PositionCorrection]) -> WindowResult | None:
        """Apply operator corrections; None: they change nothing, or the tracker does not support them."""
        return (
            self._tracker.apply_corrections(corrections)
            if isinstance(self._tracker, CorrectableTracker)
            else None
        )

    def flush(self) -> WindowResult | None:
        """Push the skipped frames, and flush the tracker."""
        results = [self._release(None), self._tracker.flush()]
        return merge_results([result for result in results if result is not None])

    def _release(self, after: tuple[int, Detections] | None) -> WindowResult | None:
        """Push the skipped frames; ``after`` is the next frame with detection."""
        results = [
            self._tracker.push(pulse, self._no_detections if found is None else found)
            for pulse, found in self._skipped.take(after)
        ]
        return merge_results([result for result in results if result is not None])
