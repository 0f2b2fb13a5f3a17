"""How long the service itself takes, and how late what it says is."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from prometheus_client import Histogram

SECONDS_BUCKETS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)
"""Upper bounds, from the encoding of one picture to a camera that is far behind."""


class StageTimers:
    """Measures the service's own stages.

    Attributes:
        decide: all that is done about one epoch: who is who, and whose view is best.
        send: telling viewers, cameras and files of one GOP, and giving its frames to everybody.
        delay: from a GOP's first pulse to its being sent.
    """

    def __init__(self) -> None:
        self.decide = _histogram("myview_decide_seconds", "Deciding one epoch.")
        self.send = _histogram("myview_send_seconds", "Telling and sending one GOP.")
        self.delay = _histogram("myview_delay_seconds", "From a GOP's first pulse to its being sent.")

    @contextmanager
    def deciding(self) -> Iterator[None]:
        """Measure what is done about an epoch."""
        with _measured(self.decide):
            yield

    @contextmanager
    def sending(self, late: Callable[[], float | None]) -> Iterator[None]:
        """Measure what is done with a GOP; ``late`` says how long ago its first pulse was due, if known."""
        with _measured(self.send):
            yield
        seconds = late()
        if seconds is not None:
            self.delay.observe(seconds)


@contextmanager
def _measured(histogram: Histogram) -> Iterator[None]:
    began = time.perf_counter()
    yield
    histogram.observe(time.perf_counter() - began)


def _histogram(name: str, description: str) -> Histogram:
    return Histogram(name, description, registry=None, buckets=SECONDS_BUCKETS)
