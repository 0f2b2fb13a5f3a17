"""Periodic tasks, for as long as the server runs."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import NoReturn

log = logging.getLogger(__name__)


async def run_periodically(every_s: float, step: Callable[[], Awaitable[None]], what: str) -> NoReturn:
    """Run a step every so many seconds; ``what`` it does is logged where it fails.

    An error does not end the loop: no one awaits its task, so the end would go unnoticed. Equal errors in a
    row are logged once.
    """
    failed = ""
    while True:
        await asyncio.sleep(every_s)
        try:
            await step()
        except Exception as error:
            if repr(error) != failed:
                log.exception("%s failed; retrying", what)
            failed = repr(error)
        else:
            failed = ""
