"""A site of the synthetic room with true boxes, fed by a test, and readers of its rendered streams."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Iterator
from dataclasses import dataclass
from functools import cache

import aiohttp
import av
import numpy as np
import pytest
from aiohttp import web
from numpy.typing import NDArray

from fakes.service.fed_site import ServedSite
from fakes.service.scripted_cameras import (
    GOP,
    STRIDE,
    FedService,
    TrackNumbers,
    camera_tracks,
    small_config,
    tracks,
    video,
)
from fakes.timeouts import PATIENCE
from server.camera.encoder import AccessUnit, Encoder
from server.config.sections import HttpSettings
from server.http.app import make_app, serving
from server.http.app_keys import SiteControl
from server.messaging.epochs import end_of_epoch
from server.messaging.messages import Box, GopChoices, TrackMessage
from server.messaging.packed_arrays import pack_boxes
from server.service.rendering import rendered_stream
from server.service.service import BestViewService
from server.system.worker import process
from synthetic import Scene

SIZE = (320, 180)
CAMERAS = ("c0", "c1")
START = 200
"""The scene's frame at pulse 0: people are in view."""

FRAMES = 150
"""The number of frames."""

Image = NDArray[np.uint8]


@cache
def room() -> Scene:
    return Scene("room", len(CAMERAS), 3, 1, *SIZE)


@cache
def units(camera: int, frames: int) -> tuple[AccessUnit, ...]:
    """Encode the frames of a camera of the room from pulse 0 on."""
    site = small_config(site={"width": SIZE[0], "height": SIZE[1]})
    encoder = Encoder(site.site, site.encode)
    return tuple(encoder.encode(pulse, room().image(camera, START + pulse)) for pulse in range(frames))


def boxes(camera: int, first: int, frames: int) -> dict[int, list[Box | None]]:
    """Return the true boxes, by person and frame."""
    boxes_by_person: dict[int, list[Box | None]] = {}
    for place in range(frames):
        truth = room().truth(START + first + place)[camera]
        for person, box in zip(truth.ids.tolist(), truth.boxes.tolist(), strict=True):
            boxes_by_person.setdefault(person, [None] * frames)[place] = tuple(box)
    return boxes_by_person


@dataclass
class DrawnSite(ServedSite):
    """The served room."""

    service: FedService
    session: aiohttp.ClientSession
    port: int
    app: web.Application
    decisions: dict[int, GopChoices]
    """Decisions by their first frame."""
    epochs: int = 0

    def advance(self, epochs: int = 1, cameras: tuple[str, ...] = CAMERAS) -> None:
        """Let the cameras send and the service decide."""
        for epoch in range(self.epochs, self.epochs + epochs):
            first = epoch * STRIDE
            for number, camera in enumerate(CAMERAS):
                if camera not in cameras:
                    continue
                for unit in units(number, FRAMES)[first : first + STRIDE]:
                    self.service.ingest.receive_video(video(camera, unit))
                seen = [
                    TrackMessage(id=person, boxes=pack_boxes(places), confidence=1.0)
                    for person, places in boxes(number, first, STRIDE).items()
                ]
                self.service.ingest.receive_tracks(
                    tracks(camera_tracks(camera, epoch, {}, tracks=seen, size=SIZE))
                )
            self.service.pulses.newest = end_of_epoch(epoch, STRIDE)
            self.service.decide()
        self.epochs += epochs

    async def advance_forever(self, period: float) -> None:
        """Let the cameras send without an end, an epoch each ``period`` seconds."""
        while True:
            await asyncio.sleep(period)
            self.advance()


async def drawn_room(control: SiteControl | None = None, **changes: object) -> AsyncIterator[DrawnSite]:
    """Yield the site; its rendering processes may take as long as a loaded machine needs."""
    with pytest.MonkeyPatch.context() as patch:
        for module, bound in (
            (process, "START_S"),
            *((rendered_stream, bound) for bound in ("START_S", "_ANSWER_S", "_PICTURE_TIMEOUT_S")),
        ):
            patch.setattr(module, bound, PATIENCE)
        async for site in _drawn_room(control, **changes):
            yield site


async def _drawn_room(control: SiteControl | None, **changes: object) -> AsyncIterator[DrawnSite]:
    service = FedService(small_config(site={"width": SIZE[0], "height": SIZE[1]}, **changes))
    service.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    decisions: dict[int, GopChoices] = {}
    service.on_decision.append(lambda choices: decisions.update({choices.first: choices}))
    app = make_app(BestViewService(service), control=control)
    async with (
        asyncio.timeout(2 * PATIENCE),
        serving(app, HttpSettings(port=0)) as port,
        aiohttp.ClientSession(f"http://127.0.0.1:{port}") as session,
    ):
        served = DrawnSite(service, session, port, app, decisions)
        service.connect_cameras(*CAMERAS)
        served.advance(4)
        yield served
    service.close()


def decoded(camera: int, frames: int) -> Iterator[Image]:
    """Yield a camera's pictures as a viewer sees them."""
    decoder = av.VideoCodecContext.create("h264", "r")
    for unit in units(camera, FRAMES)[:frames]:
        for picture in decoder.decode(av.Packet(unit.data)):
            yield picture.to_ndarray(format="bgr24")


async def read_film(answer: aiohttp.ClientResponse, frames: int) -> bytes:
    """Read a stream until it has at least ``frames`` complete frames."""
    data = b""
    while whole_frames(data) < frames:
        data += await answer.content.readany()
    return data


def whole_frames(data: bytes) -> int:
    place = count = 0
    while place + 8 <= len(data):
        size = int.from_bytes(data[place : place + 4], "big")
        if place + size > len(data):
            break
        count += data[place + 4 : place + 8] == b"mdat"
        place += size
    return count


@dataclass(frozen=True)
class JpegPart:
    """One picture of multipart JPEG."""

    pulse: int
    jpeg: bytes


async def jpeg_parts(answer: aiohttp.ClientResponse) -> AsyncGenerator[JpegPart, None]:
    """Parse multipart JPEG (RFC 2046) by its boundary and Content-Length."""
    boundary = "--" + answer.headers["Content-Type"].partition("boundary=")[2]
    stream = answer.content
    assert await stream.readline() == boundary.encode() + b"\r\n"
    while True:
        head: dict[str, str] = {}
        while (line := (await stream.readline()).decode().strip()) != "":
            name, _, value = line.partition(": ")
            head[name] = value
        if not head:
            return
        assert head["Content-Type"] == "image/jpeg"
        jpeg = await stream.readexactly(int(head["Content-Length"]))
        yield JpegPart(int(head["X-MyView-Pulse"]), jpeg)
        assert await stream.readline() == b"\r\n"
        assert await stream.readline() == boundary.encode() + b"\r\n"


__all__ = [
    "CAMERAS",
    "GOP",
    "SIZE",
    "DrawnSite",
    "JpegPart",
    "decoded",
    "drawn_room",
    "jpeg_parts",
    "read_film",
]
