"""Measurement of a live stream: picture size, frame rate, decoding errors."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import av
import numpy as np
from av.video.frame import VideoFrame
from numpy.typing import NDArray

from server.camera.sources.opening import OpenedVideo, open_video
from server.camera.sources.orientation import pixel_aspect

_SMALL = (64, 36)
"""Size to which pictures are scaled for their mean, which shows what stands still."""
_EVERY = 5
"""Pictures of which one enters the mean: scaling all of them would count as decoding."""
_MIN_PICTURES = 5
"""Fewest pictures from which a rate is computed."""


@dataclass(frozen=True, slots=True)
class StreamStats:
    """Statistics of a live stream.

    Attributes:
        size: width and height in pixels.
        fps: frames per second, by timestamps if there are any; None: too few frames.
        pictures: the number of decoded pictures.
        damaged_packets: the number of packets that could not be decoded.
        cpu_s_per_picture: processor seconds for decoding a picture.
        pixel_aspect: width of a pixel over its height.
        picture: the mean of the pictures, small, gray; None: there was none.
    """

    size: tuple[int, int]
    fps: float | None
    pictures: int
    damaged_packets: int
    cpu_s_per_picture: float
    pixel_aspect: float = 1.0
    picture: NDArray[np.float64] | None = None

    @property
    def shown_size(self) -> tuple[float, int]:
        """Width and height as displayed."""
        return self.size[0] * self.pixel_aspect, self.size[1]


def measure_stream(url: str, options: Mapping[str, str], seconds: float, open_s: float) -> StreamStats:
    """Decode a stream for ``seconds``; ``open_s`` is the timeout for opening it.

    Raises:
        UserError: it cannot be opened.
    """
    opened = open_video(url, options, (open_s, open_s))
    try:
        return _measure(opened, time.monotonic() + seconds)
    finally:
        opened.container.close()


def file_fps(file: str) -> float:
    """Return a recording's stated frame rate.

    Raises:
        UserError: it cannot be opened.
    """
    opened = open_video(file)
    opened.container.close()
    return opened.fps


def _measure(opened: OpenedVideo, until: float) -> StreamStats:
    times, stamps = list[float](), list[float]()
    small: list[NDArray[np.float64]] = []
    damaged, began = 0, time.thread_time()
    try:
        for packet in opened.container.demux(opened.stream):
            try:
                pictures = [frame for frame in packet.decode() if isinstance(frame, VideoFrame)]
            except av.error.FFmpegError:
                damaged, pictures = damaged + 1, []
            if pictures and len(times) >= _EVERY * len(small):
                gray = pictures[-1].reformat(*_SMALL, format="gray")
                small.append(gray.to_ndarray().astype(np.float64))
            times += [time.monotonic() for _ in pictures]
            stamps += [frame.time for frame in pictures if frame.time is not None]
            if time.monotonic() >= until:
                break
    except (av.error.FFmpegError, OSError):
        damaged += 1  # it stopped sending
    cpu_s = time.thread_time() - began
    # The first picture by RTSP has no time stamp.
    measured = stamps if len(stamps) > 1 else times
    span = measured[-1] - measured[0] if measured else 0.0
    fps = (len(measured) - 1) / span if len(measured) >= _MIN_PICTURES and span > 0 else None
    return StreamStats(
        opened.size,
        fps,
        len(times),
        damaged,
        cpu_s / max(1, len(times)),
        pixel_aspect(opened.stream),
        np.mean(small, axis=0) if small else None,
    )
