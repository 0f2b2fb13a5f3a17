"""The frames of a stream, recorded over HTTP and decoded by PyAV."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import aiohttp
import av
import numpy as np
from numpy.typing import NDArray

FPS = 10
"""Frame rate of the sites in these tests, low enough for a busy machine."""


async def record(
    session: aiohttp.ClientSession, url: str, is_enough: Callable[[int], bool], out: Path
) -> Path:
    """Save a stream until its newest pulse is enough."""
    data = bytearray()
    async with session.get(url) as answer:
        assert answer.status == 200, await answer.text()
        assert answer.content_type == "video/mp4"
        async for piece, _ in answer.content.iter_chunks():
            data += piece
            if is_enough(newest_pulse(data)):
                break
    out.write_bytes(data)
    return out


def newest_pulse(data: bytearray) -> int:
    """Return the pulse of the newest fragment that has begun, by its tfdt; -1 before the first."""
    at = data.rfind(b"tfdt")
    if at < 0 or len(data) < at + 16:
        return -1
    return round(int.from_bytes(data[at + 8 : at + 16], "big") * FPS / 90_000)


def pictures(path: Path) -> dict[int, NDArray[np.uint8]]:
    """Decode a stream: the picture of every pulse in YUV 4:2:0."""
    data = path.read_bytes()
    whole = data[: data.rfind(b"moof") - 4]  # the last fragment may be cut off
    with av.open(io.BytesIO(whole)) as container:
        return {
            round(frame.time * FPS): frame.to_ndarray(format="yuv420p") for frame in container.decode(video=0)
        }


def display_intervals(path: Path) -> list[tuple[float, float]]:
    """Return the start and end of each picture of a stream, in pulses."""
    data = path.read_bytes()
    with av.open(io.BytesIO(data[: data.rfind(b"moof") - 4])) as container:
        found = [
            (packet.pts, packet.duration) for packet in container.demux(video=0) if packet.pts is not None
        ]
    return [(pts * FPS / 90_000, (pts + (duration or 0)) * FPS / 90_000) for pts, duration in found]
