"""Measurements of one camera: synchronization error, tracking delay, and optimal solutions."""

from __future__ import annotations

import statistics
import time
from collections import OrderedDict, deque
from collections.abc import Callable, Collection
from dataclasses import dataclass

from prometheus_client import Histogram

from server.messaging.messages import CameraTracks, FrameHeader
from server.service.metrics.stage_timers import SECONDS_BUCKETS
from tracking.frame_rate import frames_in

_RECENT_S = 10.0
"""Seconds of the recent frames that are measured."""
_WINDOWS = 120
"""Recent windows that are measured: their interval is set in seconds, so at any rate they are of one time."""
_OPTIMAL_GAP = 1e-6
"""The largest gap of a solution that counts as none: rounding errors."""


@dataclass(frozen=True, slots=True)
class RecentSeconds:
    """Statistics of recent durations, in seconds."""

    median: float
    worst: float
    """Furthest from 0."""


@dataclass(frozen=True, slots=True)
class CameraProblem:
    """A problem of a camera, and when it occurred, unix seconds."""

    text: str
    at: float


class StageTotals:
    """Durations of a camera's stages, and quality of its windows' solutions.

    All times are differences of the camera's own clock.

    Attributes:
        take: from a pulse to the capture of its frame.
        encode: from capture to the access unit.
        search: detection in a frame, the mean of each window.
        solve: tracking to the end of a window, solver included.
        track: from the pulse of a window's last frame to its tracks, waiting included.
        windows: solved windows.
        optimal: those of them whose solution is proven optimal.
        gap: sum of the gaps of the others.
        limited: windows whose solver has reached a limit, by the limit.
        corrected: windows that revised final frames after an operator's correction.
    """

    def __init__(self) -> None:
        self.take, self.encode = _histogram(), _histogram()
        self.search, self.solve, self.track = _histogram(), _histogram(), _histogram()
        self.windows = self.optimal = self.corrected = 0
        self.gap = 0.0
        self.limited = dict.fromkeys(("work", "time"), 0)

    @property
    def stages(self) -> dict[str, Histogram]:
        """The stages by name, in the order in which a frame passes them."""
        return {name: getattr(self, name) for name in ("take", "encode", "search", "solve", "track")}

    def count_frame(self, head: FrameHeader) -> None:
        """Count a frame."""
        self.take.observe(head.captured_at - head.due)
        self.encode.observe(head.encoded - head.captured_at)

    def count_window(self, tracks: CameraTracks, due: float | None, *, optimal: bool) -> None:
        """Count a window; ``due`` is when its last frame was due, None: unknown."""
        self.corrected += tracks.revised_from is not None
        if tracks.detection_s is not None:
            self.search.observe(tracks.detection_s)
        if tracks.solve is not None:
            self.windows += 1
            self.optimal += optimal
            self.gap += 0.0 if optimal else tracks.solve.gap
            if tracks.solve.limit:
                self.limited[tracks.solve.limit] += 1
            if tracks.solve_s is not None:
                self.solve.observe(tracks.solve_s)
        if due is not None and tracks.solved_at > 0:
            self.track.observe(tracks.solved_at - due)


def _histogram() -> Histogram:
    return Histogram("myview_stage_seconds", "", registry=None, buckets=SECONDS_BUCKETS)


class CameraMetrics:
    """Measures one camera by the headers of its frames and the reports of its windows.

    All times are of the camera's own clock, and are compared only with each other.

    Args:
        fps: frames a second.
        now: returns the time, unix seconds.
    """

    def __init__(self, fps: float, now: Callable[[], float] = time.time) -> None:
        self._now, self._frames = now, frames_in(_RECENT_S, fps)
        self._errors: deque[float] = deque(maxlen=self._frames)
        self._due: OrderedDict[int, float] = OrderedDict()
        self._delays: deque[float] = deque(maxlen=_WINDOWS)
        self._optimal: deque[bool] = deque(maxlen=_WINDOWS)
        self.totals = StageTotals()
        """Totals since the start of the service, over all runs of the camera."""
        self.last_error: CameraProblem | None = None
        """The last problem; it stays when the camera has recovered."""
        self.size: tuple[int, int] | None = None
        """Width and height of the camera's image; None: unknown."""

    def reset_recent(self) -> None:
        """Discard the recent measurements, which are of an earlier run of the camera."""
        for measured in (self._errors, self._due, self._delays, self._optimal):
            measured.clear()

    def measure_frame(self, head: FrameHeader) -> None:
        """Measure a frame by its header."""
        self.totals.count_frame(head)
        self._errors.append(head.captured_at - head.due)
        self._due[head.pulse] = head.due
        while len(self._due) > self._frames:
            self._due.popitem(last=False)

    def measure_window(self, tracks: CameraTracks) -> None:
        """Measure a solved window."""
        self.size = tracks.size
        optimal = tracks.solve is not None and tracks.solve.gap <= _OPTIMAL_GAP
        if tracks.solve is not None:
            self._optimal.append(optimal)
        due = self._due.get(tracks.last)
        self.totals.count_window(tracks, due, optimal=optimal)
        if due is not None and tracks.solved_at > 0:
            self._delays.append(tracks.solved_at - due)

    def record_problem(self, text: str) -> None:
        """Record a problem, and when it occurred."""
        self.last_error = CameraProblem(" ".join(text.split()), self._now())

    @property
    def sync_error(self) -> RecentSeconds | None:
        """Seconds from a pulse to the capture of its frame; None: no frame has arrived."""
        return _spread(self._errors)

    @property
    def tracking_delay(self) -> RecentSeconds | None:
        """Seconds from the pulse of a window's last frame to its solution; None: no window has arrived."""
        return _spread(self._delays)

    @property
    def recent_solved_windows(self) -> int:
        """The number of windows behind :attr:`optimal`."""
        return len(self._optimal)

    @property
    def optimal(self) -> float | None:
        """Share of the recent windows whose solution is proven optimal; None: there are none."""
        return sum(self._optimal) / len(self._optimal) if self._optimal else None


def _spread(values: Collection[float]) -> RecentSeconds | None:
    return RecentSeconds(statistics.median(values), max(values, key=abs)) if values else None
