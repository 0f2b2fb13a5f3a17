"""Video over HTTP: playable from the first byte, with the times of pulses."""

from __future__ import annotations

import asyncio
import io

import aiohttp
import av
import numpy as np
import pytest

from fakes.service.fed_site import A, B, ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, LARGE, SMALL, encoded


async def read_stream(answer: aiohttp.ClientResponse, fragments: int) -> bytes:
    data = b""
    while data.count(b"moof") < fragments or not data.endswith(last_fragment(data)):
        data += await answer.content.readany()
    return data


def last_fragment(data: bytes) -> bytes:
    """Return the last complete fragment, or a value that no stream ends with."""
    start = data.rfind(b"mdat") - 4
    size = int.from_bytes(data[start : start + 4], "big") if start >= 0 else 0
    return data[start:] if size and len(data) - start == size else b"\x00never"


async def test_the_best_view_is_playable_from_the_first_byte_with_times_of_pulses(
    site_with_people: ServedSite,
) -> None:
    async with site_with_people.session.get("/objects/1/best.mp4") as answer:
        assert answer.status == 200
        assert answer.content_type == "video/mp4"
        assert answer.headers["Cache-Control"] == "no-store"
        data = await read_stream(answer, GOP)
        site_with_people.service.feed(3, {A: {1: SMALL}, B: {1: LARGE}})
        data += await read_stream(answer, GOP)
    with av.open(io.BytesIO(data), "r") as stream:
        pictures = list(stream.decode(video=0))
    assert [round(float(picture.time or 0) * FPS) for picture in pictures] == list(range(GOP, 3 * GOP))
    decoder = av.VideoCodecContext.create("h264", "r")
    own = [picture for unit in encoded(1) for picture in decoder.decode(av.Packet(unit.data))]
    for picture in pictures:
        pulse = round(float(picture.time or 0) * FPS)
        np.testing.assert_array_equal(
            picture.to_ndarray(format="yuv420p"), own[pulse].to_ndarray(format="yuv420p")
        )


@pytest.mark.parametrize("how", ["camera", "prefer"])
async def test_a_stream_shows_its_fixed_or_preferred_camera(site_with_people: ServedSite, how: str) -> None:
    assert (await site_with_people.get_json("/api/objects/1/choice"))["camera"] == B
    async with site_with_people.session.get(f"/objects/1/best.mp4?{how}={A}") as answer:
        data = await read_stream(answer, GOP)
    decoder = av.VideoCodecContext.create("h264", "r")
    own = [picture for unit in encoded(0) for picture in decoder.decode(av.Packet(unit.data))]
    with av.open(io.BytesIO(data), "r") as stream:
        pictures = list(stream.decode(video=0))
    assert len(pictures) == GOP
    for picture in pictures:
        pulse = round(float(picture.time or 0) * FPS)
        np.testing.assert_array_equal(
            picture.to_ndarray(format="yuv420p"), own[pulse].to_ndarray(format="yuv420p")
        )


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/objects/1/best.mp4?camera=c7", 404),
        ("/objects/7/best.mp4?camera=c0", 404),
        ("/objects/1/best.jpg?camera=c0", 400),
        ("/objects/1/best.mp4?camera=c0&overlay=1", 400),
        ("/objects/1/best.ts?camera=c0&from=-1", 400),
        ("/cameras/c0/live.mp4?camera=c1", 400),
        ("/objects/1/best.mp4?prefer=c7", 404),
        ("/objects/1/best.jpg?prefer=c0", 400),
        ("/objects/1/best.mp4?prefer=c0&camera=c1", 400),
        ("/objects/1/best.ts?prefer=c0&from=-1", 400),
    ],
)
async def test_an_invalid_fixed_or_preferred_camera_is_refused(
    site_with_people: ServedSite, path: str, status: int
) -> None:
    code, content = await site_with_people.get(path)
    assert code == status
    assert "camera" in content["error"] or "object 7" in content["error"]


async def test_a_camera_stream_begins_with_its_newest_gop(site_with_people: ServedSite) -> None:
    async with site_with_people.session.get("/cameras/c0/live.mp4") as answer:
        data = await read_stream(answer, GOP)
    with av.open(io.BytesIO(data), "r") as stream:
        times = [round(float(picture.time or 0) * FPS) for picture in stream.decode(video=0)]
    assert times == list(range(2 * GOP, 3 * GOP))


async def test_a_viewer_who_leaves_is_removed(site_with_people: ServedSite) -> None:
    async with site_with_people.session.get("/objects/1/best.mp4") as answer:
        await read_stream(answer, GOP)
        assert site_with_people.service.splicer.viewers == 1
        answer.close()
    while site_with_people.service.splicer.viewers:  # noqa: ASYNC110 — the server notices when the connection closes
        await asyncio.sleep(0.01)


async def test_an_http_1_0_client_gets_a_stream_that_is_not_chunked(site_with_people: ServedSite) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", site_with_people.port)
    writer.write(b"GET /objects/1/best.mp4 HTTP/1.0\r\n\r\n")
    head = (await reader.readuntil(b"\r\n\r\n")).lower()
    assert head.startswith(b"http/1.0 200")
    assert b"chunked" not in head
    assert b"content-length" not in head
    assert (await reader.readexactly(8))[4:] == b"ftyp"
    site_with_people.service.splicer.close()
    assert b"mdat" in await reader.read(), "the end of the stream is the end of the connection"
    writer.close()
    await writer.wait_closed()


async def test_all_viewers_receive_the_same_bytes_of_each_gop(site_with_people: ServedSite) -> None:
    connections = [await asyncio.open_connection("127.0.0.1", site_with_people.port) for _ in range(3)]
    for (_, writer), version in zip(connections, ["1.0", "1.1", "1.1"], strict=True):
        writer.write(f"GET /objects/1/best.mp4 HTTP/{version}\r\nHost: hall\r\n\r\n".encode())
    heads = [await reader.readuntil(b"\r\n\r\n") for reader, _ in connections]
    assert [b"chunked" in head for head in heads] == [False, True, True]
    while site_with_people.service.splicer.viewers < 3:  # noqa: ASYNC110 — they join one after the other
        await asyncio.sleep(0.01)
    for epoch in range(3, 8):
        site_with_people.service.feed(epoch, {A: {1: SMALL}, B: {1: LARGE}})
    site_with_people.service.splicer.close()
    old = await connections[0][0].read()
    for reader, _ in connections[1:]:
        new = b""
        while size := int(await reader.readline(), 16):
            new += (await reader.readexactly(size + 2))[:-2]
        assert new == old
    assert old.count(b"moof") == 6 * GOP
    for _, writer in connections:
        writer.close()
        await writer.wait_closed()


async def test_a_viewer_beyond_the_limit_gets_503_with_retry_after() -> None:
    async for served in serve_site(http={"viewers_max": 1}):
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(3):
            served.service.feed(epoch, {A: {1: SMALL}, B: {}})
        async with (
            served.session.get("/objects/1/best.mp4"),
            served.session.get("/objects/1/best.mp4") as second,
        ):
            assert second.status == 503
            assert second.headers["Retry-After"] == "5"
            assert "viewers_max" in (await second.json())["error"]


async def test_streams_end_when_the_server_does() -> None:
    async for served in serve_site():
        served.service.connect_cameras(*CAMERAS)
        for epoch in range(3):
            served.service.feed(epoch, {A: {1: SMALL}, B: {}})
        answers = [await served.session.get(path) for path in ("/objects/1/best.mp4", "/api/events")]
        served.service.splicer.close()
        assert (await answers[0].read()).count(b"moof") == GOP
        answers[1].close()
