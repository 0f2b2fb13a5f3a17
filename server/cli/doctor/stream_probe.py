"""Measurement of a live stream: picture size, frame rate, decoding errors."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import av
from av.video.frame import VideoFrame

from server.camera.sources.opening import OpenedVideo, open_video

_LEAST = 5
"""Fewest pictures from which a rate is computed."""


@dataclass(frozen=True, slots=True)
class StreamStats:
    """Statistics of a live stream.

    Attributes:
        size: width and height in pixels.
        fps: frames per second, by their time stamps if any; None: too few frames.
        pictures: how many could be decoded.
        damaged: how many packets could not.
        cpu_s: processor seconds for decoding one picture.
    """

    size: tuple[int, int]
    fps: float | None
    pictures: int
    damaged: int
    cpu_s: float


def measure_stream(url: str, options: Mapping[str, str], seconds: float, open_s: float) -> StreamStats:
    """Decode a stream for so many seconds.

    Raises:
        UserError: it cannot be opened.
    """
    opened = open_video(url, options, (open_s, open_s))
    try:
        return _watched(opened, time.monotonic() + seconds)
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


def _watched(opened: OpenedVideo, until: float) -> StreamStats:
    times: list[float] = []
    damaged, began = 0, time.thread_time()
    try:
        for packet in opened.container.demux(opened.stream):
            try:
                pictures = [it for it in packet.decode() if isinstance(it, VideoFrame)]
            except av.error.FFmpegError:
                damaged, pictures = damaged + 1, []
            times += [time.monotonic() if it.time is None else it.time for it in pictures]
            if time.monotonic() >= until:
                break
    except (av.error.FFmpegError, OSError):
        damaged += 1  # it stopped sending
    spent = time.thread_time() - began
    span = times[-1] - times[0] if times else 0.0
    fps = (len(times) - 1) / span if len(times) >= _LEAST and span > 0 else None
    return StreamStats(opened.size, fps, len(times), damaged, spent / max(1, len(times)))
