"""Traffic: bytes sent, GOPs lost by viewers, and the longest queue."""

from __future__ import annotations

from aiohttp import web

from server.service.facade.streams import Subscriber


class Traffic:
    """Counts bytes sent and GOPs lost.

    Attributes:
        streams: bytes of streams.
        answers: bytes of all other responses.
    """

    def __init__(self) -> None:
        self.streams = self.answers = 0
        self._viewers: set[Subscriber] = set()
        self._lost_gops = 0
        """GOPs lost by viewers who have left."""

    def join(self, viewer: Subscriber) -> None:
        """Add a viewer; the caller calls :meth:`leave` at the end."""
        self._viewers.add(viewer)

    def leave(self, viewer: Subscriber) -> None:
        """Remove a viewer, and keep the count of its lost GOPs."""
        self._viewers.discard(viewer)
        self._lost_gops += viewer.lost_gops

    @property
    def lost_gops(self) -> int:
        """The number of GOPs that viewers have lost because they fell behind."""
        return self._lost_gops + sum(viewer.lost_gops for viewer in self._viewers)

    @property
    def longest_queue(self) -> int:
        """The number of chunks queued for the viewer that is furthest behind."""
        return max((viewer.queued for viewer in self._viewers), default=0)

    async def count_body(self, request: web.Request, response: web.StreamResponse) -> None:
        """Add the bytes of a response's body to ``answers``; streams are counted as they are sent."""
        if isinstance(response, web.Response) and request.method != "HEAD":
            self.answers += response.content_length or 0


TRAFFIC = web.AppKey("traffic", Traffic)
