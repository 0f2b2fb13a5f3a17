"""Small videos, intact and damaged, in which each frame has its own gray level."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.video.stream import VideoStream

WIDTH, HEIGHT = 64, 48
STEP = 10
"""Difference in gray between two frames."""


def write_video(path: Path, frames: int, *, codec: str = "libx264", b_frames: int = 0, fps: int = 25) -> Path:
    """Write a video whose frame n has the gray STEP * n; a keyframe every 10 frames."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=fps)
        assert isinstance(stream, VideoStream)
        stream.width, stream.height = WIDTH, HEIGHT
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        if codec == "libx264":
            stream.options = {
                "preset": "veryfast",
                "crf": "8",
                "g": "10",
                "bf": str(b_frames),
                "sc_threshold": "0",
            }
        for number in range(frames):
            picture = np.full((HEIGHT, WIDTH, 3), STEP * number, dtype=np.uint8)
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24")
            frame.pts, frame.time_base = number, Fraction(1, fps)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def write_timed(
    path: Path,
    times: Sequence[float],
    *,
    fps: int = 25,
    pictures: Sequence[np.ndarray[tuple[int, ...], np.dtype[np.uint8]]] | None = None,
    codec: str = "libx264",
    prepare: Callable[[VideoStream], None] = lambda _: None,
) -> Path:
    """Write a video at given times, seconds: frame n has the gray STEP * (n % 25), or is picture n."""
    unit = Fraction(1, 90_000)
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=fps)
        assert isinstance(stream, VideoStream)
        first = pictures[0] if pictures else np.zeros((HEIGHT, WIDTH, 3))
        stream.width, stream.height = first.shape[1], first.shape[0]
        stream.pix_fmt = "yuv420p" if codec == "libx264" else "yuvj420p"
        stream.time_base = stream.codec_context.time_base = unit
        if codec == "libx264":
            stream.options = {"preset": "veryfast", "crf": "8", "bf": "0"}
        prepare(stream)
        for number, time in enumerate(times):
            picture = pictures[number] if pictures else _gray_picture(number)
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24")
            frame.pts, frame.time_base = round(time / unit), unit
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def _gray_picture(number: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    return np.full((HEIGHT, WIDTH, 3), STEP * (number % 25), dtype=np.uint8)


def damage(path: Path, packets: list[int]) -> Path:
    """Overwrite packets, numbered in decoding order, with noise."""
    with av.open(str(path)) as container:
        places = [(packet.pos or 0, packet.size) for packet in container.demux(video=0) if packet.size]
    data = bytearray(path.read_bytes())
    for number in packets:
        start, size = places[number]
        data[start : start + size] = np.random.default_rng(number).bytes(size)
    path.write_bytes(data)
    return path


def frame_in(picture: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> int:
    """Return the frame number of a picture."""
    return round(float(picture.mean()) / STEP)
