"""A site with tokens whose object 1 leaves for a while; object 2 stays in the room."""

from __future__ import annotations

import asyncio
import io
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import cache
from pathlib import Path
from typing import Any, Literal

import aiohttp
import av
import numpy as np
from numpy.typing import NDArray

from fakes.http.tokens import bearer, locked
from fakes.service.fed_site import A, B, Hall
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, LARGE, SMALL, encoded
from server.messaging.messages import Box, GopChoices

Picture = NDArray[np.uint8]
Codec = Literal["h264", "vp8"]

EPOCHS, GONE = 24, range(4, 16)
"""The number of epochs, and those in which no camera shows object 1."""
UNSEEN = 2 * GOP
"""Frames after which object 1 is frozen."""
ACCESS = {"hide_after_s": UNSEEN / FPS}
PATIENT = {"viewer_queue_gops": 100}  # for slow readers
GRAY = 128
ELSEWHERE: Box = (40.0, 10.0, 46.0, 28.0)
"""Where object 2 is."""


@asynccontextmanager
async def left(folder: Path, **changes: Any) -> AsyncIterator[Hall]:
    """Serve the site, before the first frame."""
    changes = {"access": ACCESS, "http": PATIENT, **changes}
    async with locked(folder, **changes) as hall:
        hall.service.frames = EPOCHS * GOP
        hall.service.come(*CAMERAS)
        yield hall


def go_on(hall: Hall, epochs: range) -> list[GopChoices]:
    """Feed some epochs; return the decisions made meanwhile."""
    decisions: list[GopChoices] = []
    hall.service.on_decision.append(decisions.append)
    for epoch in epochs:
        there = epoch not in GONE
        seen_by_a = {1: SMALL if there else None, 2: ELSEWHERE}  # the first one becomes object 1
        hall.service.feed(epoch, {A: seen_by_a, B: {1: LARGE if there else None}})
    hall.service.on_decision.remove(decisions.append)
    return decisions


def expected(decisions: list[GopChoices], codec: Codec = "h264", *, holds: bool = True) -> dict[int, Picture]:
    """Return the pictures for a viewer with access to object 1 alone, by pulse, of all decisions.

    ``holds``: before it turns gray, the last picture stays.
    """
    shown: dict[int, Picture] = {}
    seen_last = -1 - 2 * UNSEEN
    for gop in decisions:
        camera = gop.choices[1]
        seen = [
            gop.first + place
            for frames in gop.boxes.values()
            for place, boxes in enumerate(frames)
            if any(box[0] == 1 for box in boxes)
        ]
        seen_last = max([seen_last, *seen])
        age = gop.first - seen_last
        for pulse in range(gop.first, gop.first + gop.frames):
            if age <= UNSEEN:
                shown[pulse] = own(camera, codec)[pulse]
            elif holds and age <= 2 * UNSEEN:
                shown[pulse] = shown[pulse - 1]
            else:
                shown[pulse] = np.full_like(own(camera)[pulse], GRAY)
    return shown


@cache
def own(camera: str, codec: Codec = "h264") -> list[Picture]:
    """Decode a camera's own pictures, in YUV 4:2:0."""
    decoder = av.VideoCodecContext.create(codec, "r")
    units = encoded(CAMERAS.index(camera), EPOCHS * GOP, codec=codec)
    packets = [*(av.Packet(unit.data) for unit in units), None]
    return [frame.to_ndarray(format="yuv420p") for packet in packets for frame in decoder.decode(packet)]


def decoded(data: bytes) -> dict[int, Picture]:
    """Decode a stream strictly; return the picture of each pulse."""
    with av.open(io.BytesIO(data), "r", options={"err_detect": "explode"}) as stream:
        stream.streams.video[0].codec_context.options = {"err_detect": "explode"}
        frames = list(stream.decode(video=0))
    return {round(float(frame.time or 0) * FPS): frame.to_ndarray(format="yuv420p") for frame in frames}


def equal(shown: dict[int, Picture], right: dict[int, Picture]) -> None:
    """Assert that pictures are equal by pulse, without a gap, up to the same end."""
    assert list(shown) == list(range(min(shown), len(right)))
    for pulse, picture in shown.items():
        np.testing.assert_array_equal(picture, right[pulse], str(pulse))


def chosen(decisions: list[GopChoices], codec: Codec = "h264") -> dict[int, Picture]:
    """Return the pictures for viewers with access to all persons."""
    cameras = {
        pulse: decision.choices[1]
        for decision in decisions
        for pulse in range(decision.first, decision.first + decision.frames)
    }
    return {pulse: own(camera, codec)[pulse] for pulse, camera in cameras.items()}


def is_gray(picture: Picture) -> bool:
    return bool((picture == GRAY).all())


async def begun(hall: Hall, path: str, who: str) -> aiohttp.ClientResponse:
    """Open a stream."""
    answer = await hall.session.get(path, headers=bearer(who))
    assert answer.status == 200, await answer.text()
    return answer


async def fetched(hall: Hall, path: str, who: str) -> bytes:
    async with await begun(hall, path, who) as answer:
        return await answer.read()


async def to_the_end(hall: Hall, *answers: aiohttp.ClientResponse) -> list[bytes]:
    """End all streams; return what was sent."""
    hall.service.splicer.close()
    return await asyncio.gather(*(answer.read() for answer in answers))
