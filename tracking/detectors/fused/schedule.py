"""When the network runs: once per interval, and earlier where it is needed. No clock: frames are counted."""

from __future__ import annotations

from tracking.frame_rate import frames_in

_NEEDED_FASTER = 2
"""Runs per interval where the network is needed."""
_SPARE_RUNS, _SPARE_PER_S = 3.0, 1.0
"""Runs that may come early in a row, and how many of them are regained in a second."""


class NetworkSchedule:
    """Decides by frame numbers, so that the same frames have the same runs, live and offline."""

    def __init__(self, interval_s: float, fps: float) -> None:
        self._unstretched = frames_in(interval_s, fps)
        self.every = self._unstretched
        """Frames per regular run."""
        self._spare_per_frame = _SPARE_PER_S / fps
        self._spare = _SPARE_RUNS
        self._last_frame: int | None = None
        self._last_run: int | None = None

    def stretch(self, factor: int) -> None:
        """Let a regular run come once in ``factor`` intervals from now on."""
        self.every = factor * self._unstretched

    def is_due(self, frame: int, *, needed: bool) -> bool:
        """Return whether the network runs on a frame, which counts as a run then. Frames ascend.

        Args:
            frame: its number. Regular runs are on multiples of `every`, or the first frame after one.
            needed: whether something would be better known now.
        """
        since = frame - (frame if self._last_frame is None else self._last_frame)
        self._spare = min(self._spare + self._spare_per_frame * since, _SPARE_RUNS)
        self._last_frame = frame
        is_due = self._last_run is None or frame // self.every != self._last_run // self.every
        if not is_due and needed and self._last_run is not None:
            until_next = self.every - frame % self.every
            early = max(self.every // _NEEDED_FASTER, 1)
            is_due = min(frame - self._last_run, until_next) >= early and self._spare >= 1.0
            self._spare -= float(is_due)
        if is_due:
            self._last_run = frame
        return is_due
