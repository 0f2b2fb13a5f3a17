"""How long the service itself takes, and how late what it says is."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from server.service.metrics.histogram import Histogram


class StageTimers:
    """Measures the service's own stages.

    Attributes:
        decide: all that is done about one epoch: who is who, and whose view is best.
        send: telling viewers, cameras and files of one GOP, and giving its frames to everybody.
        delay: from a GOP's first pulse to its being sent.
    """

    def __init__(self) -> None:
        self.decide, self.send, self.delay = Histogram(), Histogram(), Histogram()

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
