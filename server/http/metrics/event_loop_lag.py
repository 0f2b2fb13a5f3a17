"""Event loop lag: how late the event loop wakes tasks."""

from __future__ import annotations

import asyncio

from prometheus_client import Histogram

from server.service.metrics.stage_timers import SECONDS_BUCKETS

_EVERY_S = 0.25


class LoopLag:
    """Measures how late repeated sleeps of ``every_s`` seconds end."""

    def __init__(self, every_s: float = _EVERY_S) -> None:
        self._every_s = every_s
        self.histogram = Histogram(
            "myview_loop_lag_seconds",
            "How late the event loop is.",
            registry=None,
            buckets=SECONDS_BUCKETS,
        )

    async def run(self) -> None:
        """Measure until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            due = loop.time() + self._every_s
            await asyncio.sleep(self._every_s)
            self.histogram.observe(max(0.0, loop.time() - due))
