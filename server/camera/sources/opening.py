"""Opens video with FFmpeg; error texts tell the user what to do."""

from __future__ import annotations

import errno
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

import av
from av.container import InputContainer
from av.stream import Disposition
from av.video.codeccontext import VideoCodecContext
from av.video.stream import VideoStream

from server.camera.sources.frame_timing import frame_rate
from server.config.source_address import is_device_path
from server.system.address_redaction import ffmpeg_reason, redact_to_host
from server.system.errors import UserError, reason_of

_TEXT = "tty"
"""FFmpeg's format for text files, which it would render as letters."""


class VideoError(UserError):
    """A video cannot be opened, or has no pictures; ``reason`` is the text without the video's name."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f"{name}: {reason}")
        self.reason = reason


@dataclass(frozen=True, slots=True)
class OpenedVideo:
    """An open video.

    Attributes:
        container: the file or connection.
        stream: its first video stream.
        size: width and height as stored; the first frame carries the orientation.
        fps: its declared frame rate.
        frames: its declared number of frames; 0: not declared.
        video_streams: number of video streams, without cover images.
    """

    container: InputContainer
    stream: VideoStream
    size: tuple[int, int]
    fps: float
    frames: int
    video_streams: int = 1


def open_video(
    source: str,
    options: Mapping[str, str] | None = None,
    timeout: tuple[float, float] | None = None,
) -> OpenedVideo:
    """Open the first video stream; ``timeout`` is (seconds to open, seconds to read).

    Raises:
        VideoError: it cannot be opened, or there is no video in it.
    """
    name, began = redact_to_host(source), time.monotonic()
    try:
        container = av.open(
            source,
            format="v4l2" if is_device_path(source) else None,
            options=dict(options or {}),
            timeout=timeout,
        )
    except (av.error.FFmpegError, OSError, ValueError) as error:
        reason = timeout_message(error, timeout[0]) if timeout else None
        if timeout and time.monotonic() - began >= timeout[0]:
            reason = _no_answer(timeout[0])  # whatever FFmpeg makes of its interruption
        # FFmpeg's text contains the address, and so would a chained traceback.
        raise VideoError(name, f"cannot open this video: {reason or _reason(source, error)}") from None
    if container.format.name == _TEXT:
        container.close()
        raise VideoError(
            name,
            "this is text, not video; for detections use --det, or `detections` next to a camera's source",
        )
    videos = [
        stream for stream in container.streams.video if not stream.disposition & Disposition.attached_pic
    ]
    if not videos:
        container.close()
        raise VideoError(name, "there is no video in this file")
    stream = videos[0]
    context: VideoCodecContext | None = stream.codec_context  # it may be missing, contrary to PyAV's types
    if context is None or not context.width or not context.height:
        container.close()
        raise VideoError(name, "cannot decode this video: it has no frame size; is the file complete?")
    context.thread_count = 1  # one process per camera already uses the cores
    size = (context.width, context.height)
    return OpenedVideo(container, stream, size, frame_rate(stream), stream.frames, len(videos))


def timeout_message(error: Exception, seconds: float) -> str | None:
    """Return the error text for a timeout of ``seconds``; None for other errors."""
    return _no_answer(seconds) if isinstance(error, av.error.ExitError) else None


def _no_answer(seconds: float) -> str:
    return f"no answer within {seconds:g} s"


def _reason(source: str, error: Exception) -> str:
    """Return the reason; FFmpeg reports an unknown host as an input/output error only."""
    if isinstance(error, OSError) and error.errno == errno.EIO and "://" in source:
        try:
            socket.getaddrinfo(urlsplit(source).hostname, None)
        except socket.gaierror as resolution_error:
            return reason_of(resolution_error)
        except ValueError:
            pass  # not a valid address
    return ffmpeg_reason(error)
