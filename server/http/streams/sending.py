"""Sending endless answers: video and events, each at its viewer's own pace."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import AsyncIterable, Callable, Mapping
from functools import lru_cache

from aiohttp import web

from server.http.viewers.traffic import TRAFFIC, Traffic
from server.service.facade.streams import Broadcaster, Chunk, Subscriber

log = logging.getLogger(__name__)

_SEND_BUFFER_BYTES = 65_536
"""What the kernel may buffer of a stream: else it would hold a minute for slow readers, unseen."""
_STREAM_HEADERS = {
    "Cache-Control": "no-store",
    "Access-Control-Allow-Origin": "*",
    "X-Accel-Buffering": "no",  # or a proxy in front collects what should be live
}


PieceWriter = Callable[[Chunk], bytes]
"""Writes a piece of a stream in some container."""


def plain(piece: Chunk) -> bytes:
    """Return a piece's own bytes."""
    return piece.data


async def send_stream(
    request: web.Request,
    channel: Broadcaster,
    head: bytes,
    headers: Mapping[str, str],
    write_piece: PieceWriter = plain,
) -> web.StreamResponse:
    """Send ``head`` and then the channel for as long as both live."""
    viewer = channel.subscribe()
    try:
        return await send_viewer(request, viewer, head, headers, write_piece)
    finally:
        channel.unsubscribe(viewer)


async def send_viewer(
    request: web.Request,
    viewer: Subscriber,
    head: bytes,
    headers: Mapping[str, str],
    write_piece: PieceWriter = plain,
) -> web.StreamResponse:
    """Send ``head`` and what a viewer is sent, who has joined a channel and will leave it."""

    def ready(response: web.StreamResponse) -> None:
        if request.transport is not None:
            chunked = response.headers.get("Transfer-Encoding") == "chunked"
            viewer.direct_send = _direct_writer(request.transport, write_piece, traffic, chunked=chunked)

    traffic = request.app[TRAFFIC]
    traffic.join(viewer)
    pieces = (write_piece(piece) async for piece in viewer.chunks())
    try:
        return await send_bytes(request, pieces, head, headers, ready)
    finally:
        viewer.direct_send = None
        traffic.leave(viewer)


def _direct_writer(
    transport: asyncio.Transport, write_piece: PieceWriter, traffic: Traffic, *, chunked: bool
) -> Callable[[Chunk], bool]:
    """Return what writes a piece at once where nothing of the one before is buffered.

    It is called for every viewer of every GOP, so all lookups are done beforehand.
    """
    is_closing, waiting, write = transport.is_closing, transport.get_write_buffer_size, transport.write

    def take(piece: Chunk) -> bool:
        if waiting() or is_closing():
            return False
        data = write_piece(piece)
        write(_chunk(data) if chunked else data)
        traffic.streams += len(data)
        return True

    return take


@lru_cache(maxsize=8)
def _chunk(data: bytes) -> bytes:
    """Return data as a chunk (RFC 9112, 7.1), encoded once for all viewers."""
    return b"%x\r\n%b\r\n" % (len(data), data)


async def send_bytes(
    request: web.Request,
    data: AsyncIterable[bytes],
    head: bytes,
    headers: Mapping[str, str],
    ready: Callable[[web.StreamResponse], None] = lambda _: None,
) -> web.StreamResponse:
    """Send ``head`` and all of ``data``; to HEAD, neither. ``ready`` is called when the head is written."""
    response = web.StreamResponse(headers={**_STREAM_HEADERS, **headers})
    await response.prepare(request)
    if request.method == "HEAD":
        return response
    _limit_send_buffer(request)
    traffic = request.app[TRAFFIC]
    try:
        if head:
            await response.write(head)
            traffic.streams += len(head)
        ready(response)
        async for piece in data:
            await response.write(piece)
            traffic.streams += len(piece)
        await response.write_eof()
    except (ConnectionError, TimeoutError) as error:
        log.debug("viewer disconnected: %s", error)
    return response


def _limit_send_buffer(request: web.Request) -> None:
    """Let the kernel buffer no more than can be sent soon: slow viewers lose GOPs and do not fall behind."""
    option = getattr(socket, "TCP_NOTSENT_LOWAT", None)  # not on every system
    connection = request.get_extra_info("socket")
    if option is not None and connection is not None:
        connection.setsockopt(socket.IPPROTO_TCP, option, _SEND_BUFFER_BYTES)
