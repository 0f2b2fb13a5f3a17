"""Streams for all kinds of clients: HTTP/1.0, range requests, other origins, slow connections."""

from __future__ import annotations

import asyncio
import socket
import struct

import pytest

from fakes.service.fed_site import A, B, ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, GOP, SMALL
from server.service.streaming.subscriber_queue import BytesChunk

STREAMS = {
    "/objects/1/best.mp4": "video/mp4",
    "/cameras/c0/live.mp4": "video/mp4",
    "/objects/1/best.ts": "video/mp2t",
    "/cameras/c0/live.ts": "video/mp2t",
}
NOT_HERE = {"Host": "hall"}
"""Not a name of this machine, so not an operator."""
GET = "GET {} HTTP/1.1\r\nHost: hall\r\n\r\n"


async def send_request(
    served: ServedSite, request: str
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter, str]:
    """Send a raw request; return the connection and the response head in lower case."""
    reader, writer = await asyncio.open_connection("127.0.0.1", served.port)
    writer.write(request.encode())
    return reader, writer, (await reader.readuntil(b"\r\n\r\n")).decode().lower()


async def deserted(served: ServedSite) -> None:
    """Wait until there are no viewers."""
    while served.service.splicer.viewers:  # noqa: ASYNC110 — the server notices when the connection closes
        await asyncio.sleep(0.005)


@pytest.mark.parametrize("path", STREAMS)
async def test_head_takes_no_slot_and_keeps_the_connection_usable(
    site_with_people: ServedSite, path: str
) -> None:
    reader, writer, head = await send_request(site_with_people, GET.format(path).replace("GET", "HEAD"))
    for _ in range(2):
        assert head.startswith("http/1.1 200")
        assert f"content-type: {STREAMS[path]}\r\n" in head
        assert "access-control-allow-origin: *" in head
        assert site_with_people.service.splicer.viewers == 0
        writer.write(b"HEAD /healthz HTTP/1.1\r\nHost: hall\r\n\r\n")
        assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 200"), "no body before"
        writer.write(GET.format(path).replace("GET", "HEAD").encode())
        head = (await reader.readuntil(b"\r\n\r\n")).decode().lower()
    writer.close()


@pytest.mark.parametrize("path", STREAMS)
async def test_an_http_1_0_client_gets_a_stream_until_the_connection_closes(
    site_with_people: ServedSite, path: str
) -> None:
    reader, writer, head = await send_request(site_with_people, f"GET {path} HTTP/1.0\r\n\r\n")
    assert head.startswith("http/1.0 200")
    assert "chunked" not in head
    assert "content-length" not in head
    begin = await reader.readexactly(8)
    assert begin[4:] == b"ftyp" if path.endswith(".mp4") else begin[0] == 0x47
    site_with_people.service.splicer.close()
    rest = await reader.read()
    assert len(begin + rest) % 188 == 0 or path.endswith(".mp4"), "whole packets"
    writer.close()


@pytest.mark.parametrize("path", STREAMS)
async def test_a_range_request_gets_the_whole_stream(site_with_people: ServedSite, path: str) -> None:
    for ranges in ("bytes=0-", "bytes=0-1", "bytes=1000000-"):
        async with site_with_people.session.get(path, headers={"Range": ranges}) as answer:
            assert answer.status == 200
            assert not {"Accept-Ranges", "Content-Range", "Content-Length"} & set(answer.headers)


@pytest.mark.parametrize("path", [*STREAMS, "/objects/1/hls/index.m3u8", "/api/objects", "/api/events"])
async def test_pages_of_other_origins_may_request_streams(site_with_people: ServedSite, path: str) -> None:
    asking = {"Origin": "http://elsewhere", "Access-Control-Request-Method": "GET"}
    async with site_with_people.session.options(path, headers=asking) as answer:
        assert answer.status == 204
        assert answer.headers["Access-Control-Allow-Origin"] == "*"
        assert "GET" in answer.headers["Access-Control-Allow-Methods"]
        assert answer.headers["Access-Control-Allow-Headers"] == "*, Authorization"
    assert site_with_people.service.splicer.viewers == 0
    async with site_with_people.session.options("/nothing", headers=asking) as answer:
        assert answer.status == 404


@pytest.mark.parametrize("path", STREAMS)
async def test_a_broken_connection_frees_its_slot(site_with_people: ServedSite, path: str) -> None:
    _, writer, _ = await send_request(site_with_people, GET.format(path))
    assert site_with_people.service.splicer.viewers == 1
    writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    writer.transport.abort()
    await deserted(site_with_people)


@pytest.mark.parametrize("limit", ["viewers_max", "viewers_per_object"])
async def test_beyond_the_limit_a_viewer_gets_503_with_retry_after(limit: str) -> None:
    async for served in serve_site(http={limit: 2}):
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(3):
            served.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {}})
        _, first, _ = await send_request(served, GET.format("/objects/1/best.mp4"))
        _, second, _ = await send_request(served, GET.format("/objects/1/best.ts"))
        async with served.session.get("/objects/1/best.mp4", headers=NOT_HERE) as answer:
            assert answer.status == 503
            assert int(answer.headers["Retry-After"]) > 0
            assert limit in (await answer.json())["error"]
        async with served.session.get("/objects/2/best.mp4", headers=NOT_HERE) as answer:
            assert answer.status == (503 if limit == "viewers_max" else 200)
        for writer in (first, second):
            writer.close()
        await deserted(served)
        async with served.session.get("/objects/1/best.ts") as answer:
            assert answer.status == 200, "a slot is free again"


async def test_a_slow_viewer_loses_whole_gops_without_affecting_others(site_with_people: ServedSite) -> None:
    broadcaster = site_with_people.service.splicer.persons[1]
    stalled = socket.socket()
    stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    stalled.connect(("127.0.0.1", site_with_people.port))
    stalled.sendall(b"GET /objects/1/best.mp4 HTTP/1.0\r\n\r\n")
    reader, writer, _ = await send_request(site_with_people, "GET /objects/1/best.mp4 HTTP/1.0\r\n\r\n")
    while broadcaster.viewers < 2:  # noqa: ASYNC110 — both have come
        await asyncio.sleep(0.005)
    await reader.readuntil(b"mdat")
    gops = [b"<GOP %05d" % number + bytes([65 + number % 26]) * 100_000 + b">" for number in range(150)]
    for gop in gops:
        broadcaster.publish(BytesChunk(gop, random_access=True))
        await reader.readuntil(gop)
    slow = next(viewer for viewer in broadcaster._subscribers if viewer.lost_gops)
    assert len(slow._queue) <= site_with_people.service.config.http.viewer_queue_gops
    assert sum(viewer.lost_gops for viewer in broadcaster._subscribers) == slow.lost_gops, (
        "only the slow reader loses"
    )
    if hasattr(socket, "TCP_NOTSENT_LOWAT"):
        assert slow.lost_gops > len(gops) - 50, "small socket buffers: queued data would be shown late"
    broadcaster.close()
    loop, got = asyncio.get_running_loop(), b""
    stalled.setblocking(False)  # noqa: FBT003 — the name of the method says it
    while data := await loop.sock_recv(stalled, 1 << 20):
        got += data
    kept = [gop for gop in gops if gop in got]
    assert got.endswith(gops[-1]), "it continues with the newest"
    assert got.count(b"<GOP") == len(kept) == len(gops) - slow.lost_gops, "none is incomplete"
    stalled.close()
    writer.close()


async def test_a_viewer_that_disconnects_while_blocked_is_removed(site_with_people: ServedSite) -> None:
    broadcaster = site_with_people.service.splicer.persons[1]
    _, writer, _ = await send_request(site_with_people, "GET /objects/1/best.mp4 HTTP/1.0\r\n\r\n")
    for _ in range(100):
        broadcaster.publish(BytesChunk(bytes(100_000), random_access=True))
        await asyncio.sleep(0)
    writer.transport.abort()
    await deserted(site_with_people)


async def test_transport_streams_are_muxed_only_while_watched(site_with_people: ServedSite) -> None:
    kept = site_with_people.service.splicer.persons[1]._backlog
    assert not any("mpegts" in vars(piece) for piece in kept)
    async with (
        site_with_people.session.get("/objects/1/best.ts") as one,
        site_with_people.session.get("/objects/1/best.ts") as two,
    ):
        data = await one.content.readexactly(188 * 16)
        assert await two.content.readexactly(188 * 16) == data
        assert data[0] == data[188] == 0x47
    assert all("mpegts" in vars(piece) for piece in kept)
    assert len(kept[0].pictures) == GOP  # type: ignore[attr-defined]
