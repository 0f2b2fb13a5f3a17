"""Traffic: bytes sent, and how far behind viewers are."""

from __future__ import annotations

from aiohttp import web

from server.service.facade.streams import Subscriber


class Traffic:
    """Counts bytes of streams and of other answers, and what viewers lose.

    Attributes:
        streams: bytes of endless answers.
        answers: bytes of all others.
    """

    def __init__(self) -> None:
        self.streams = self.answers = 0
        self._viewers: set[Subscriber] = set()
        self._lost = 0
        """GOPs lost by viewers who have left."""

    def join(self, viewer: Subscriber) -> None:
        """Count a viewer's losses from now on; call :meth:`leave` in the end."""
        self._viewers.add(viewer)

    def leave(self, viewer: Subscriber) -> None:
        """Keep what a viewer has lost, who leaves."""
        self._viewers.discard(viewer)
        self._lost += viewer.lost_gops

    @property
    def lost(self) -> int:
        """How many GOPs viewers have lost because they fell behind."""
        return self._lost + sum(viewer.lost_gops for viewer in self._viewers)

    @property
    def longest_queue(self) -> int:
        """How many pieces wait for the viewer who is furthest behind."""
        return max((viewer.queued for viewer in self._viewers), default=0)

    async def count(self, request: web.Request, response: web.StreamResponse) -> None:
        """Count an answer that has a body of its own; streams count themselves."""
        if isinstance(response, web.Response) and request.method != "HEAD":
            self.answers += response.content_length or 0


TRAFFIC = web.AppKey("traffic", Traffic)
