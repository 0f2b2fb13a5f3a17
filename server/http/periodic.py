"""Periodic tasks, for as long as the server runs."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import NoReturn

log = logging.getLogger(__name__)


async def run_periodically(every_s: float, step: Callable[[], Awaitable[None]], what: str) -> NoReturn:
    """Run a step every so many seconds; ``what`` it does is logged where it fails.

    Nobody awaits the task that runs this: were it to end with the first error, nobody would see. So the next
    step is run all the same; one that fails as the one before it is not logged again.
    """
    failed = ""
    while True:
        await asyncio.sleep(every_s)
        try:
            await step()
        except Exception as error:
            if repr(error) != failed:
                log.exception("%s failed; it is tried again", what)
            failed = repr(error)
        else:
            failed = ""
