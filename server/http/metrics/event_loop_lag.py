"""Event loop lag: how late tasks of the HTTP process are woken."""

from __future__ import annotations

import asyncio

from prometheus_client import Histogram

from server.service.metrics.stage_timers import SECONDS_BUCKETS

_EVERY_S = 0.25


class LoopLag:
    """Sleeps for ``every_s`` again and again, and measures how much later it wakes."""

    def __init__(self, every_s: float = _EVERY_S) -> None:
        self._every_s = every_s
        self.histogram = Histogram(
            "myview_loop_lag_seconds",
            "How late the event loop is.",
            registry=None,
            buckets=SECONDS_BUCKETS,
        )

    async def run(self) -> None:
        """Measure for as long as the loop runs."""
        loop = asyncio.get_running_loop()
        while True:
            due = loop.time() + self._every_s
            await asyncio.sleep(self._every_s)
            self.histogram.observe(max(0.0, loop.time() - due))
