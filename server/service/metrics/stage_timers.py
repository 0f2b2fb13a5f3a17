"""Durations of the service's own stages, and the delay of its decisions."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from prometheus_client import Histogram

SECONDS_BUCKETS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)
"""Upper bounds of the histogram buckets."""


class StageTimers:
    """Measures the service's own stages.

    Attributes:
        track: joint tracking of one epoch, where cameras are tracked jointly.
        decide: one epoch, from identities to view selection.
        send: publishing one GOP to viewers, bus and files.
        delay: from a GOP's first pulse until it is sent.
    """

    def __init__(self) -> None:
        self.track = _histogram("myview_joint_tracking_seconds", "Joint tracking of one epoch.")
        self.decide = _histogram("myview_decide_seconds", "Deciding one epoch.")
        self.send = _histogram("myview_send_seconds", "Publishing one GOP.")
        self.delay = _histogram("myview_delay_seconds", "From a GOP's first pulse until it is sent.")

    @contextmanager
    def tracking(self) -> Iterator[None]:
        """Measure the joint tracking of an epoch."""
        with _measured(self.track):
            yield

    @contextmanager
    def deciding(self) -> Iterator[None]:
        """Measure the decision about an epoch."""
        with _measured(self.decide):
            yield

    @contextmanager
    def sending(self, delay: Callable[[], float | None]) -> Iterator[None]:
        """Measure the sending of a GOP; ``delay`` returns the seconds since its first pulse, if known."""
        with _measured(self.send):
            yield
        seconds = delay()
        if seconds is not None:
            self.delay.observe(seconds)


@contextmanager
def _measured(histogram: Histogram) -> Iterator[None]:
    began = time.perf_counter()
    yield
    histogram.observe(time.perf_counter() - began)


def _histogram(name: str, description: str) -> Histogram:
    return Histogram(name, description, registry=None, buckets=SECONDS_BUCKETS)
