"""The RTSP gateway: clients get the cameras' own pictures, with a token for them, through everything."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace
from itertools import count
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from fakes.http.tokens import TOKEN_ENTRIES, serve_with_tokens, token_entry, token_of, write_tokens
from fakes.media.decoding import video_decoder
from fakes.rtsp.client import rtsp_client
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
from server.media.picture import Codec
from server.messaging.epochs import end_of_epoch
from server.service.identity.sharding import AreaSighting, ShardingByArea

pytestmark = needs_gstreamer

PICTURES = 100 * STRIDE
"""Each camera's, all different; then they come again."""


@asynccontextmanager
async def live(served: ServedSite) -> AsyncIterator[None]:
    """Let a site run in real time or slower; its person is larger in the other camera every other GOP."""
    served.service.connect_cameras(*CAMERAS)
    codec = served.service.config.encode.codec

    async def run() -> None:
        for epoch in count():
            for seed, camera in enumerate(CAMERAS):
                for pulse in range(epoch * STRIDE, (epoch + 1) * STRIDE):
                    unit = replace(encoded(seed, PICTURES, codec=codec)[pulse % PICTURES], pulse=pulse)
                    served.service.ingest.receive_video(video(camera, unit))
                size = LARGE if (epoch + seed) % 2 else SMALL
                served.service.ingest.receive_tracks(tracks(camera_tracks(camera, epoch, {1: size})))
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


def own_pictures(camera: int, codec: Codec = "h264") -> dict[bytes, int]:
    """Return the number of each of a camera's pictures, by its decoded pixels."""
    decoder = video_decoder(codec)
    units = encoded(camera, PICTURES, codec=codec)
    frames = [frame for unit in units for frame in decoder.decode(av.Packet(unit.data))]
    frames += decoder.decode(None)
    return {pixels(frame): number for number, frame in enumerate(frames)}


def pixels(frame: av.VideoFrame) -> bytes:
    array: NDArray[np.uint8] = frame.to_ndarray(format="yuv420p")
    return array.tobytes()


def steps(numbers: Sequence[int]) -> list[int]:
    """Return by how many pictures each is later than the one before; what goes back steps far."""
    return [int(step) for step in np.diff(numbers) % PICTURES]


def watch(url: str, transport: str = "tcp") -> Iterator[av.VideoFrame]:
    with av.open(url, options={"rtsp_transport": transport}, timeout=PATIENCE) as container:
        yield from container.decode(video=0)


async def frames_of(url: str, count: int, transport: str = "tcp") -> list[av.VideoFrame]:
    def run() -> list[av.VideoFrame]:
        return [frame for frame, _ in zip(watch(url, transport), range(count), strict=False)]

    return await asyncio.to_thread(run)


@asynccontextmanager
async def watching(url: str) -> AsyncIterator[list[av.VideoFrame]]:
    """Watch a stream; yield the frames, which become more."""
    frames: list[av.VideoFrame] = []
    leaving = threading.Event()

    def run() -> None:
        for frame in watch(url):
            frames.append(frame)
            if leaving.is_set():
                return

    task = asyncio.create_task(asyncio.to_thread(run))
    try:
        await until(lambda: bool(frames) or task.done())
        yield frames
    finally:
        leaving.set()
        await task


async def more(frames: list[av.VideoFrame], number: int) -> None:
    """Wait for so many more."""
    before = len(frames)
    await until(lambda: len(frames) >= before + number)


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
    shown = [own[pixels(frame)] for frame in frames if pixels(frame) in own]
    if transport == "tcp":
        assert steps(shown) == [1] * 19
    else:  # a machine that is too busy may lose packets, and what is predicted from them
        assert shown
        assert all(0 < step < PICTURES / 2 for step in steps(shown))


@pytest.mark.parametrize("parameters", ["equal", "own"])
async def test_h265_has_the_cameras_own_pictures(tmp_path: Path, parameters: str) -> None:
    own = [await asyncio.to_thread(own_pictures, camera, "h265") for camera in range(len(CAMERAS))]
    async with (
        serve_with_tokens(tmp_path, encode={"codec": "h265", "parameters": parameters}) as served,
        live(served),
        run_gateway(served.port) as gateway,
    ):
        frames = await frames_of(gateway.url("/objects/1", token_of("family")), 20)
    shown = [next(one[pixels(frame)] for one in own if pixels(frame) in one) for frame in frames]
    assert steps(shown) == [1] * 19


async def test_a_best_view_goes_on_through_cuts_with_the_cameras_own_pictures(
    gateway: RunningGateway,
) -> None:
    own = [await asyncio.to_thread(own_pictures, camera) for camera in range(len(CAMERAS))]
    frames = await frames_of(gateway.url("/objects/1", token_of("family")), 40)
    shown = [
        next((camera, one[pixels(frame)]) for camera, one in enumerate(own) if pixels(frame) in one)
        for frame in frames
    ]
    assert steps([number for _, number in shown]) == [1] * 39
    assert {camera for camera, _ in shown} == {0, 1}
    times = [frame.time for frame in frames if frame.time is not None]
    assert np.median(np.diff(times)) == pytest.approx(1 / FPS, abs=0.005), (
        "evenly, though whole GOPs come at once"
    )


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
        ("/cameras/c0", basic("any", token_of("guest")), 403),
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


async def test_clients_beyond_the_most_are_refused_until_one_leaves(gateway: RunningGateway) -> None:
    desk = token_of("desk")

    async def status() -> int:
        return (await gateway.describe("/cameras/c0", basic("any", desk)))[0]

    async with watching(gateway.url("/cameras/c0", desk)) as staying:
        async with watching(gateway.url("/cameras/c0", desk)):
            assert await status() == 503
        while await status() != 200:  # noqa: ASYNC110 — the gateway notices when a connection closes
            await asyncio.sleep(0.05)
        await more(staying, 2 * FPS)


@pytest.mark.parametrize("path", ["/cameras/c0", "/objects/1"])
async def test_clients_that_come_as_others_leave_get_pictures(site: ServedSite, path: str) -> None:
    async with run_gateway(site.port, clients_max=12) as gateway:

        async def one_after_another() -> None:
            for _ in range(4):
                assert len(await frames_of(gateway.url(path, token_of("desk")), 3)) == 3

        await asyncio.gather(*(one_after_another() for _ in range(3)))


async def test_a_client_that_has_torn_down_its_stream_gets_it_again(gateway: RunningGateway) -> None:
    async with rtsp_client(gateway, "/cameras/c0", basic("any", token_of("door"))) as client:
        for _ in range(2):
            await client.set_up()
            await client.tear_down()


@pytest.mark.parametrize(
    ("path", "token", "pause", "waiting"), [("/cameras/c0", "door", 2, 0), ("/objects/1", "family", 4, 1)]
)
async def test_a_client_that_pauses_and_plays_again_is_live(
    site: ServedSite, gateway: RunningGateway, path: str, token: str, pause: int, waiting: int
) -> None:
    """`waiting`: seconds of a best view that wait for their time when it is paused."""

    async def passed(pulses: int) -> None:
        end = site.service.pulses.newest + pulses
        await until(lambda: site.service.pulses.newest >= end)

    async with rtsp_client(gateway, path, basic("any", token_of(token))) as client:
        await client.set_up()
        await client.request("PLAY")
        await until(lambda: client.pictures >= FPS)
        await client.request("PAUSE")
        paused = client.pictures
        await passed(pause * FPS)
        assert client.pictures == paused
        resumed = site.service.pulses.newest
        await client.request("PLAY")
        await passed((pause + 1) * FPS)
        await until(lambda: client.pictures >= paused + pause * FPS)
        came, sent = client.pictures - paused, site.service.pulses.newest - resumed
        assert came <= sent + waiting * FPS + 2 * STRIDE, "nothing of the pause"


async def test_a_client_goes_on_when_the_connection_to_the_service_breaks(site: ServedSite) -> None:
    own = await asyncio.to_thread(own_pictures, 1)
    async with (
        breakable_connections(site.port) as connections,
        run_gateway(connections.port) as gateway,
        watching(gateway.url("/cameras/c1", token_of("desk"))) as frames,
    ):
        for number in (2, 3):
            connections.break_all()
            await until(lambda number=number: connections.opened >= number)  # type: ignore[misc]
            await more(frames, FPS)
    shown = [own[pixels(frame)] for frame in frames if pixels(frame) in own]
    assert len(shown) > len(frames) / 2, "all but those with a picture missing before them"
    assert all(0 < step < PICTURES / 2 for step in steps(shown))


async def test_a_client_stays_when_somebody_walks_into_another_area(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = [await asyncio.to_thread(own_pictures, camera) for camera in range(len(CAMERAS))]
    areas = [{"cameras": ["c0"], "also": ["c1"]}, {"cameras": ["c1"], "also": ["c0"]}]
    async with serve_with_tokens(tmp_path) as east, live(east):
        servers = ["http://127.0.0.1:1/", f"http://127.0.0.1:{east.port}/"]
        sharding = {"of": 2, "areas": areas, "servers": servers}
        async with (
            serve_with_tokens(tmp_path, view={"sharding": sharding}) as west,
            live(west),
            run_gateway(west.port) as gateway,
            watching(gateway.url("/objects/1", token_of("desk"))) as frames,
        ):
            area = west.service.decider.people.sharding
            assert isinstance(area, ShardingByArea)
            await more(frames, FPS)
            assert east.service.splicer.viewers == 0
            area.set_sightings({1: AreaSighting(1, 1_000_000, is_visible=True)})
            # The other service says so from now on.
            monkeypatch.setattr(area, "set_sightings", lambda _: None)
            await until(lambda: east.service.splicer.viewers == 1)
            await more(frames, 2 * FPS)
            assert len(await frames_of(gateway.url("/objects/1", token_of("family")), 3)) == 3, "from there"
            assert (await gateway.describe("/objects/1"))[0] == 401
            assert west.service.splicer.viewers == 0
    shown = [frame for frame in frames if any(pixels(frame) in one for one in own)]
    assert len(shown) > 0.9 * len(frames)


async def test_services_that_redirect_to_each_other_are_unavailable(tmp_path: Path) -> None:
    async with serve_with_tokens(tmp_path, view={"sharding": {"of": 2, "index": 1}}) as served:
        sharding = served.service.config.view.sharding.model_copy(
            update={"servers": [f"http://127.0.0.1:{served.port}/"] * 2}
        )
        view = served.service.config.view.model_copy(update={"sharding": sharding})
        served.service.config = served.service.config.model_copy(update={"view": view})
        async with run_gateway(served.port) as gateway:
            assert (await gateway.describe("/objects/2", basic("any", token_of("desk"))))[0] == 503


async def test_without_a_service_streams_are_unavailable() -> None:
    async with run_gateway(free_port()) as gateway:
        assert (await gateway.describe("/cameras/c0"))[0] == 503


class BreakableConnections:
    """Passes connections on to a port."""

    def __init__(self, onward: int) -> None:
        self.port, self.opened = 0, 0
        self._onward = onward
        self._writers: set[asyncio.StreamWriter] = set()

    async def accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.opened += 1
        beyond, onward = await asyncio.open_connection("127.0.0.1", self._onward)
        await asyncio.gather(self._copy(reader, onward), self._copy(beyond, writer))

    async def _copy(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        with contextlib.suppress(OSError):
            while data := await reader.read(65_536):
                writer.write(data)
                await writer.drain()
        writer.close()

    def break_all(self) -> None:
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()


@asynccontextmanager
async def breakable_connections(port: int) -> AsyncIterator[BreakableConnections]:
    """Pass connections on to a port until all are broken."""
    connections = BreakableConnections(port)
    server = await asyncio.start_server(connections.accept, "127.0.0.1", 0)
    connections.port = server.sockets[0].getsockname()[1]
    try:
        yield connections
    finally:
        connections.break_all()
        server.close()


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not condition():  # noqa: ASYNC110 — other tasks and processes decide
            await asyncio.sleep(0.02)
