"""Measurement of a live stream: picture size, frame rate, decoding errors."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import av
from av.video.frame import VideoFrame

from server.camera.sources.opening import OpenedVideo, open_video

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
    """

    size: tuple[int, int]
    fps: float | None
    pictures: int
    damaged_packets: int
    cpu_s_per_picture: float


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
    times: list[float] = []
    damaged, began = 0, time.thread_time()
    try:
        for packet in opened.container.demux(opened.stream):
            try:
                pictures = [frame for frame in packet.decode() if isinstance(frame, VideoFrame)]
            except av.error.FFmpegError:
                damaged, pictures = damaged + 1, []
            times += [time.monotonic() if frame.time is None else frame.time for frame in pictures]
            if time.monotonic() >= until:
                break
    except (av.error.FFmpegError, OSError):
        damaged += 1  # it stopped sending
    cpu_s = time.thread_time() - began
    span = times[-1] - times[0] if times else 0.0
    fps = (len(times) - 1) / span if len(times) >= _MIN_PICTURES and span > 0 else None
    return StreamStats(opened.size, fps, len(times), damaged, cpu_s / max(1, len(times)))
