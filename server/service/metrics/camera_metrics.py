"""What is measured of one camera: how far it is from the pulse, how late its tracks are, what was proven."""

from __future__ import annotations

import statistics
import time
from collections import OrderedDict, deque
from collections.abc import Callable, Collection
from dataclasses import dataclass

from prometheus_client import Histogram

from server.messaging.messages import CameraTracks, FrameHeader
from server.service.metrics.stage_timers import SECONDS_BUCKETS

_FRAMES = 250
"""Frames that are measured: ten seconds at 25 a second."""
_WINDOWS = 120
_PROVEN = 1e-6
"""A gap of a program that is taken for none: what is left of rounding."""


@dataclass(frozen=True, slots=True)
class RecentSeconds:
    """Seconds, as they were lately."""

    median: float
    worst: float
    """Furthest from 0."""


@dataclass(frozen=True, slots=True)
class CameraProblem:
    """What went wrong, and when: unix seconds."""

    text: str
    at: float


class StageTotals:
    """How long each stage of a camera took, and how well its windows were solved.

    All times are differences of the camera's own clock.

    Attributes:
        take: from a pulse to its picture.
        encode: from the picture to its access unit.
        search: looking for people in a frame: the mean of each window.
        solve: following everybody to the end of a window, its program solved.
        track: from the pulse of a window's last frame to its tracks, with all that it waited for.
        windows: how many programs were solved.
        certified: how many answers of them are proven to be the best there is.
        gap: the sum of the gaps of the others.
        mended: how many windows have changed what was final, as an operator pointed at somebody.
    """

    def __init__(self) -> None:
        self.take, self.encode = _histogram(), _histogram()
        self.search, self.solve, self.track = _histogram(), _histogram(), _histogram()
        self.windows = self.certified = self.mended = 0
        self.gap = 0.0

    @property
    def stages(self) -> dict[str, Histogram]:
        """Return the stages by name, in the order in which a frame goes through them."""
        return {name: getattr(self, name) for name in ("take", "encode", "search", "solve", "track")}

    def frame(self, head: FrameHeader) -> None:
        """Count a frame."""
        self.take.observe(head.taken - head.due)
        self.encode.observe(head.encoded - head.taken)

    def window(self, tracks: CameraTracks, due: float | None, *, proven: bool) -> None:
        """Count a window; ``due`` is when its last frame was, None: not known."""
        self.mended += tracks.revised_from is not None
        if tracks.search_s is not None:
            self.search.observe(tracks.search_s)
        if tracks.solve is not None:
            self.windows += 1
            self.certified += proven
            self.gap += 0.0 if proven else tracks.solve.gap
            if tracks.solve_s is not None:
                self.solve.observe(tracks.solve_s)
        if due is not None and tracks.solved_at > 0:
            self.track.observe(tracks.solved_at - due)


def _histogram() -> Histogram:
    return Histogram("myview_stage_seconds", "", registry=None, buckets=SECONDS_BUCKETS)


class CameraMetrics:
    """Measures one camera by the heads of its frames and the reports of its windows.

    Frames and windows carry times of the camera's own clock, and are compared with nothing else.
    """

    def __init__(self, now: Callable[[], float] = time.time) -> None:
        self._now = now
        self._errors: deque[float] = deque(maxlen=_FRAMES)
        self._due: OrderedDict[int, float] = OrderedDict()
        self._delays: deque[float] = deque(maxlen=_WINDOWS)
        self._proven: deque[bool] = deque(maxlen=_WINDOWS)
        self.totals = StageTotals()
        """Since the service began: another run of the camera is added."""
        self.last_error: CameraProblem | None = None
        """Stays when the camera is well again."""
        self.size: tuple[int, int] | None = None
        """Width and height of the camera's own picture; None: it has not said."""

    def begin(self) -> None:
        """Forget what was measured of another run of the camera."""
        for measured in (self._errors, self._due, self._delays, self._proven):
            measured.clear()

    def frame(self, head: FrameHeader) -> None:
        """Take in a frame that came."""
        self.totals.frame(head)
        self._errors.append(head.taken - head.due)
        self._due[head.pulse] = head.due
        while len(self._due) > _FRAMES:
            self._due.popitem(last=False)

    def window(self, tracks: CameraTracks) -> None:
        """Take in a window that was solved."""
        self.size = tracks.size
        proven = tracks.solve is not None and tracks.solve.gap <= _PROVEN
        if tracks.solve is not None:
            self._proven.append(proven)
        due = self._due.get(tracks.last)
        self.totals.window(tracks, due, proven=proven)
        if due is not None and tracks.solved_at > 0:
            self._delays.append(tracks.solved_at - due)

    def trouble(self, text: str) -> None:
        """Note what went wrong."""
        self.last_error = CameraProblem(" ".join(text.split()), self._now())

    @property
    def sync_error(self) -> RecentSeconds | None:
        """How long after its pulse a frame was taken; None: no frame came."""
        return _spread(self._errors)

    @property
    def tracking_delay(self) -> RecentSeconds | None:
        """How long after the pulse of a window's last frame it was solved; None: none was."""
        return _spread(self._delays)

    @property
    def windows(self) -> int:
        """How many windows `certified` is about."""
        return len(self._proven)

    @property
    def certified(self) -> float | None:
        """Share of the windows whose answer is proven to be the best there is; None: there were none."""
        return sum(self._proven) / len(self._proven) if self._proven else None


def _spread(values: Collection[float]) -> RecentSeconds | None:
    return RecentSeconds(statistics.median(values), max(values, key=abs)) if values else None
