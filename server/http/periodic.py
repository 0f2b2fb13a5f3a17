"""What is done again and again, for as long as the server runs."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import NoReturn

log = logging.getLogger(__name__)


async def again_and_again(every_s: float, turn: Callable[[], Awaitable[None]], what: str) -> NoReturn:
    """Take a turn every so many seconds; ``what`` it is says the log where one fails.

    Nobody waits for the task in which this is done: were it to end with the first mistake, nobody would see.
    So the next turn is taken all the same; one that fails as the one before it is not told of again.
    """
    failed = ""
    while True:
        await asyncio.sleep(every_s)
        try:
            await turn()
        except Exception as error:
            if repr(error) != failed:
                log.exception("%s failed; it is tried again", what)
            failed = repr(error)
        else:
            failed = ""
