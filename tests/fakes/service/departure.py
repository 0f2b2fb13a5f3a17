"""A site with tokens whose object 1 leaves for a while; object 2 stays in the room."""

from __future__ import annotations

import asyncio
import io
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import cache
from pathlib import Path
from typing import Any

import aiohttp
import av
import numpy as np
from numpy.typing import NDArray

from fakes.http.tokens import bearer, serve_with_tokens
from fakes.media.decoding import video_decoder
from fakes.service.fed_site import A, B, ServedSite
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, LARGE, SMALL, encoded
from server.media.picture import Codec
from server.messaging.messages import Box, GopChoices

Picture = NDArray[np.uint8]

EPOCHS, ABSENT = 24, range(4, 16)
"""The number of epochs, and those in which no camera shows object 1."""
HIDE_AFTER = 2 * GOP
"""Frames after which object 1 is frozen."""
ACCESS = {"hide_after_s": HIDE_AFTER / FPS}
PATIENT_HTTP = {"viewer_queue_gops": 100}  # for slow readers
GRAY = 128
SECOND_PERSON: Box = (40.0, 10.0, 46.0, 28.0)
"""Where object 2 is."""


@asynccontextmanager
async def departure_site(folder: Path, **changes: Any) -> AsyncIterator[ServedSite]:
    """Serve the site, before the first frame."""
    changes = {"access": ACCESS, "http": PATIENT_HTTP, **changes}
    async with serve_with_tokens(folder, **changes) as served:
        served.service.frames = EPOCHS * GOP
        served.service.connect_cameras(*CAMERAS)
        yield served


def feed_epochs(served: ServedSite, epochs: range) -> list[GopChoices]:
    """Feed some epochs; return the decisions."""
    decisions: list[GopChoices] = []
    served.service.on_decision.append(decisions.append)
    for epoch in epochs:
        is_present = epoch not in ABSENT
        seen_by_a = {1: SMALL if is_present else None, 2: SECOND_PERSON}  # the first one becomes object 1
        served.service.feed(epoch, {A: seen_by_a, B: {1: LARGE if is_present else None}})
    served.service.on_decision.remove(decisions.append)
    return decisions


def expected_pictures(
    decisions: list[GopChoices], codec: Codec = "h264", *, freezes: bool = True
) -> dict[int, Picture]:
    """Return the pictures for a viewer with access to object 1 alone, by pulse, of all decisions.

    ``freezes``: the last picture stays until it turns gray.
    """
    shown: dict[int, Picture] = {}
    seen_last = -1 - 2 * HIDE_AFTER
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
            if age <= HIDE_AFTER:
                shown[pulse] = camera_pictures(camera, codec)[pulse]
            elif freezes and age <= 2 * HIDE_AFTER:
                shown[pulse] = shown[pulse - 1]
            else:
                shown[pulse] = np.full_like(camera_pictures(camera)[pulse], GRAY)
    return shown


@cache
def camera_pictures(camera: str, codec: Codec = "h264") -> list[Picture]:
    """Decode a camera's own pictures, in YUV 4:2:0."""
    decoder = video_decoder(codec)
    units = encoded(CAMERAS.index(camera), EPOCHS * GOP, codec=codec)
    packets = [*(av.Packet(unit.data) for unit in units), None]
    return [frame.to_ndarray(format="yuv420p") for packet in packets for frame in decoder.decode(packet)]


def decoded(data: bytes) -> dict[int, Picture]:
    """Decode a stream strictly; return the picture of each pulse."""
    with av.open(io.BytesIO(data), "r", options={"err_detect": "explode"}) as stream:
        stream.streams.video[0].codec_context.options = {"err_detect": "explode"}
        frames = list(stream.decode(video=0))
    return {round(float(frame.time or 0) * FPS): frame.to_ndarray(format="yuv420p") for frame in frames}


def assert_equal_pictures(shown: dict[int, Picture], expected: dict[int, Picture]) -> None:
    """Assert that pictures are equal by pulse, without a gap, up to the same end."""
    assert list(shown) == list(range(min(shown), len(expected)))
    for pulse, picture in shown.items():
        np.testing.assert_array_equal(picture, expected[pulse], str(pulse))


def chosen_pictures(decisions: list[GopChoices], codec: Codec = "h264") -> dict[int, Picture]:
    """Return the pictures for viewers with access to all persons."""
    cameras = {
        pulse: decision.choices[1]
        for decision in decisions
        for pulse in range(decision.first, decision.first + decision.frames)
    }
    return {pulse: camera_pictures(camera, codec)[pulse] for pulse, camera in cameras.items()}


def is_gray(picture: Picture) -> bool:
    return bool((picture == GRAY).all())


async def open_stream(served: ServedSite, path: str, token: str) -> aiohttp.ClientResponse:
    """Open a stream."""
    answer = await served.session.get(path, headers=bearer(token))
    assert answer.status == 200, await answer.text()
    return answer


async def fetch(served: ServedSite, path: str, token: str) -> bytes:
    async with await open_stream(served, path, token) as answer:
        return await answer.read()


async def finish_streams(served: ServedSite, *answers: aiohttp.ClientResponse) -> list[bytes]:
    """End all streams; return what was sent."""
    served.service.splicer.close()
    return await asyncio.gather(*(answer.read() for answer in answers))
