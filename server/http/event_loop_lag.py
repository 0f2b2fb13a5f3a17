"""How long the event loop keeps everybody waiting."""

from __future__ import annotations

import asyncio

from server.service.metrics.histogram import Histogram

_EVERY_S = 0.25


class Lag:
    """Sleeps again and again, and measures how much later than asked for it wakes."""

    def __init__(self, every_s: float = _EVERY_S) -> None:
        self._every_s = every_s
        self.histogram = Histogram()

    async def run(self) -> None:
        """Measure for as long as the loop runs."""
        loop = asyncio.get_running_loop()
        while True:
            due = loop.time() + self._every_s
            await asyncio.sleep(self._every_s)
            self.histogram.observe(max(0.0, loop.time() - due))
