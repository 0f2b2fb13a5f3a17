"""Sending of streams: video and events, to each viewer at the pace of its connection."""

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
"""Limit of unsent data in the kernel: without it, it could buffer a minute of a stream for a slow viewer."""
_STREAM_HEADERS = {
    "Cache-Control": "no-store",
    "Access-Control-Allow-Origin": "*",
    "X-Accel-Buffering": "no",  # otherwise a proxy may buffer a live stream
}


ChunkWriter = Callable[[Chunk], bytes]
"""Returns the bytes of a chunk in a container."""


def plain(chunk: Chunk) -> bytes:
    """Return a chunk's bytes unchanged."""
    return chunk.data


async def send_stream(
    request: web.Request,
    channel: Broadcaster,
    head: bytes,
    headers: Mapping[str, str],
    write_chunk: ChunkWriter = plain,
) -> web.StreamResponse:
    """Send ``head`` and then a channel, until it ends or the viewer leaves."""
    viewer = channel.subscribe()
    try:
        return await send_viewer(request, viewer, head, headers, write_chunk)
    finally:
        channel.unsubscribe(viewer)


async def send_viewer(
    request: web.Request,
    viewer: Subscriber,
    head: bytes,
    headers: Mapping[str, str],
    write_chunk: ChunkWriter = plain,
) -> web.StreamResponse:
    """Send ``head`` and the chunks of a viewer; the caller subscribes and unsubscribes the viewer."""

    def on_head_sent(response: web.StreamResponse) -> None:
        if request.transport is not None:
            chunked = response.headers.get("Transfer-Encoding") == "chunked"
            viewer.direct_send = _direct_writer(request.transport, write_chunk, traffic, chunked=chunked)

    traffic = request.app[TRAFFIC]
    traffic.join(viewer)
    chunks = (write_chunk(chunk) async for chunk in viewer.chunks())
    try:
        return await send_bytes(request, chunks, head, headers, on_head_sent)
    finally:
        viewer.direct_send = None
        traffic.leave(viewer)


def _direct_writer(
    transport: asyncio.Transport, write_chunk: ChunkWriter, traffic: Traffic, *, chunked: bool
) -> Callable[[Chunk], bool]:
    """Return a function that writes a chunk at once if the transport has no unsent data.

    It is called for every viewer and GOP, so all lookups are done beforehand.
    """
    is_closing, unsent_bytes, write = transport.is_closing, transport.get_write_buffer_size, transport.write

    def send(chunk: Chunk) -> bool:
        if unsent_bytes() or is_closing():
            return False
        data = write_chunk(chunk)
        write(_http_chunk(data) if chunked else data)
        traffic.streams += len(data)
        return True

    return send


@lru_cache(maxsize=8)
def _http_chunk(data: bytes) -> bytes:
    """Return data in the chunked transfer coding (RFC 9112, 7.1), encoded once for all viewers."""
    return b"%x\r\n%b\r\n" % (len(data), data)


async def send_bytes(
    request: web.Request,
    data: AsyncIterable[bytes],
    head: bytes,
    headers: Mapping[str, str],
    on_head_sent: Callable[[web.StreamResponse], None] = lambda _: None,
) -> web.StreamResponse:
    """Send ``head`` and ``data``, or only headers to HEAD; call ``on_head_sent`` once ``head`` is."""
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
        on_head_sent(response)
        async for chunk in data:
            await response.write(chunk)
            traffic.streams += len(chunk)
        await response.write_eof()
    except (ConnectionError, TimeoutError) as error:
        log.debug("viewer disconnected: %s", error)
    return response


def _limit_send_buffer(request: web.Request) -> None:
    """Limit the kernel's send buffer, so that slow viewers lose GOPs instead of falling behind."""
    option = getattr(socket, "TCP_NOTSENT_LOWAT", None)  # not on every system
    connection = request.get_extra_info("socket")
    if option is not None and connection is not None:
        connection.setsockopt(socket.IPPROTO_TCP, option, _SEND_BUFFER_BYTES)
