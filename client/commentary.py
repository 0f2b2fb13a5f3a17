"""Which camera a stream shows, from the events beside it."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from client.events import events
from client.http import ClientError, HttpSettings
from client.model import Event, Gop, Site

_log = logging.getLogger(__name__)
_GOPS = 64  # remembered: far more than the picture is behind the events


class Commentary:
    """Remembers the last choices for one object."""

    def __init__(self, number: int) -> None:
        self._number = number
        self._fps: float | None = None
        self._gops: deque[Gop] = deque(maxlen=_GOPS)

    def take(self, event: Event) -> None:
        """Take what an event says about the object."""
        if isinstance(event, Site):
            self._fps = event.fps
        elif isinstance(event, Gop):
            self._gops.append(event)

    def camera_at(self, media_time: float | None) -> str | None:
        """Give the camera shown at ``media_time`` (seconds: pulse / fps); None if it is not known."""
        if media_time is None or self._fps is None:
            return None
        pulse = round(media_time * self._fps)
        for gop in reversed(self._gops):
            if gop.first <= pulse < gop.first + gop.frames:
                return gop.choices.get(self._number)
        return None


@asynccontextmanager
async def following(url: str, number: int, settings: HttpSettings) -> AsyncIterator[Commentary]:
    """Follow the events inside the block; that they cannot be had does not disturb who watches."""
    commentary = Commentary(number)

    async def follow() -> None:
        try:
            async for event in events(url, settings):
                commentary.take(event)
        except ClientError as error:
            _log.info("no events: %s", error)

    task = asyncio.create_task(follow())
    try:
        yield commentary
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
