"""Endless answers: video and events, each at its viewer's own pace."""

from __future__ import annotations

import asyncio
import logging
import socket
import struct
from collections.abc import AsyncIterable, Callable, Mapping
from functools import lru_cache

from aiohttp import web

from server.http.traffic import SENT, Sent
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.subscriber_queue import Chunk, Subscriber

log = logging.getLogger(__name__)

_WAITING_BYTES = 65_536
"""What of a stream may wait in the system: else it would keep a minute for who reads too slowly, unseen."""
_RESET = struct.pack("ii", 1, 0)
"""Of a connection that is not to be closed in good order: (on, seconds)."""
_STREAM_HEADERS = {
    "Cache-Control": "no-store",
    "Access-Control-Allow-Origin": "*",
    "X-Accel-Buffering": "no",  # or a proxy in front collects what should be live
}


Form = Callable[[Chunk], bytes]
"""How the pieces of a stream become bytes."""


def plain(piece: Chunk) -> bytes:
    """Give a piece's own bytes."""
    return piece.data


async def send_stream(
    request: web.Request, channel: Broadcaster, head: bytes, headers: Mapping[str, str], form: Form = plain
) -> web.StreamResponse:
    """Send ``head`` and then the channel for as long as both live."""
    viewer = channel.subscribe()
    try:
        return await send_viewer(request, viewer, head, headers, form)
    finally:
        channel.unsubscribe(viewer)


async def send_viewer(
    request: web.Request, viewer: Subscriber, head: bytes, headers: Mapping[str, str], form: Form = plain
) -> web.StreamResponse:
    """Send ``head`` and what a viewer is given, from a place that the caller took and will give up."""

    def ready(response: web.StreamResponse) -> None:
        if request.transport is not None:
            chunked = response.headers.get("Transfer-Encoding") == "chunked"
            viewer.direct_send = _at_once(request.transport, form, sent, chunked=chunked)

    sent = request.app[SENT]
    sent.join(viewer)
    pieces = (form(piece) async for piece in viewer.chunks())
    try:
        return await send_bytes(request, pieces, head, headers, ready)
    finally:
        viewer.direct_send = None
        sent.leave(viewer)


def _at_once(
    transport: asyncio.Transport, form: Form, sent: Sent, *, chunked: bool
) -> Callable[[Chunk], bool]:
    """Give what writes a piece where nothing of the one before waits; what the system leaves follows.

    It is called for every viewer of every GOP: what it would look up, the last of them waits for.
    """
    is_closing, waiting, write = transport.is_closing, transport.get_write_buffer_size, transport.write

    def take(piece: Chunk) -> bool:
        if waiting() or is_closing():
            return False
        data = form(piece)
        write(_chunk(data) if chunked else data)
        sent.streams += len(data)
        return True

    return take


@lru_cache(maxsize=8)
def _chunk(data: bytes) -> bytes:
    """Give data as a chunk (RFC 9112, 7.1), once for all who are sent them."""
    return b"%x\r\n%b\r\n" % (len(data), data)


async def send_bytes(
    request: web.Request,
    data: AsyncIterable[bytes],
    head: bytes,
    headers: Mapping[str, str],
    ready: Callable[[web.StreamResponse], None] = lambda _: None,
) -> web.StreamResponse:
    """Send ``head`` and all of ``data``; of HEAD, neither. ``ready`` is called when the head is written."""
    response = web.StreamResponse(headers={**_STREAM_HEADERS, **headers})
    await response.prepare(request)
    if request.method == "HEAD":
        return response
    _keep_little_waiting(request)
    sent = request.app[SENT]
    try:
        if head:
            await response.write(head)
            sent.streams += len(head)
        ready(response)
        async for some in data:
            await response.write(some)
            sent.streams += len(some)
        await response.write_eof()
    except (ConnectionError, TimeoutError) as error:
        log.debug("a viewer has gone: %s", error)
    return response


def break_off(request: web.Request) -> None:
    """End an answer in its middle so that its reader knows: by HTTP/1.0 any other end is a right one."""
    connection = request.get_extra_info("socket")
    if connection is not None:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
    if request.transport is not None:
        request.transport.abort()


def _keep_little_waiting(request: web.Request) -> None:
    """Let the system take no more than can be sent soon: who is slow is to lose GOPs, not to fall behind."""
    option = getattr(socket, "TCP_NOTSENT_LOWAT", None)  # not on every system
    connection = request.get_extra_info("socket")
    if option is not None and connection is not None:
        connection.setsockopt(socket.IPPROTO_TCP, option, _WAITING_BYTES)
