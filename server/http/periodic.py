"""Periodic background tasks."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import NoReturn

log = logging.getLogger(__name__)


async def run_periodically(every_s: float, step: Callable[[], Awaitable[None]], name: str) -> NoReturn:
    """Run a step every ``every_s`` seconds; ``name`` is its name in the log.

    An error does not end the loop: its task is not awaited, so its end would go unnoticed. Consecutive equal
    errors are logged once.
    """
    failed = ""
    while True:
        await asyncio.sleep(every_s)
        try:
            await step()
        except Exception as error:
            if repr(error) != failed:
                log.exception("%s failed; retrying", name)
            failed = repr(error)
        else:
            failed = ""
