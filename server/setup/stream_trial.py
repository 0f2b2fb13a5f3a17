"""Trial of a source: opens it, measures what it sends, and takes a picture."""

from __future__ import annotations

import contextlib
import itertools
import time
from pathlib import Path

import av
import cv2
import msgspec
import numpy as np
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from server.camera.passthrough.access_units import parse_packing
from server.camera.passthrough.compatibility import OR_ENCODE, IncompatibleStreamError, required_format
from server.camera.passthrough.stream_source import check_stream
from server.camera.sources.opening import OpenedVideo, VideoError, open_video
from server.camera.sources.orientation import parse_orientation, pixel_aspect
from server.config.loader import load_config
from server.media.h264.codec import H264
from server.media.h265.codec import H265
from server.media.nal_units import nal_units
from server.setup.trial_messages import StreamRequest, StreamTrial
from server.system.address_redaction import redact_to_host
from server.system.errors import UserError
from tracking.image_scaling import scale_image

_OPEN_S, _READ_S = 8.0, 5.0
_WATCHED_S = 1.5
_LEAST_PICTURES = 8
"""Pictures from which a rate is computed."""
_LONGEST_S = 6.0
_PICTURE_WIDTH = 480
_QUALITY = 80
_RATES = (5, 6, 7.5, 8, 10, 12, 12.5, 15, 20, 24, 25, 30, 50, 60)
"""Usual rates, to which a measured one is rounded."""
_NEARLY = 0.04


def run_trial(request: StreamRequest) -> StreamTrial:
    """Open a source and return what it sends, or why nothing arrives."""
    try:
        opened = open_video(request.source, request.options, (_OPEN_S, _READ_S))
    except VideoError as error:
        return StreamTrial(error=error.reason)
    try:
        trial = _watch(opened)
    finally:
        opened.container.close()
    if not request.site or trial.error:
        return trial
    name = redact_to_host(request.source)
    return msgspec.structs.replace(trial, error=_misfit(request).removeprefix(f"{name}: "))


def _misfit(request: StreamRequest) -> str:
    """Return why a source's own video cannot be passed through into a site's streams; empty: it can."""
    try:
        check_stream(request.source, request.options, required_format(load_config(Path(request.site))))
    except IncompatibleStreamError as error:
        return f"passthrough: pass: {error}; {OR_ENCODE}"
    except UserError as error:
        return str(error)
    return ""


def _watch(opened: OpenedVideo) -> StreamTrial:
    times, arrivals = list[float](), list[float]()
    picture: VideoFrame | None = None
    size_bytes, began = 0, time.monotonic()
    order = _PictureOrder(opened)
    try:
        for packet in opened.container.demux(opened.stream):
            size_bytes += packet.size or 0
            order.add(packet)
            try:
                pictures = [frame for frame in packet.decode() if isinstance(frame, VideoFrame)]
            except av.error.FFmpegError:
                pictures = []  # damaged; the next keyframe repairs it
            for picture in pictures:
                arrivals.append(time.monotonic())
                times += [] if picture.time is None else [picture.time]
            seconds = time.monotonic() - began
            if seconds > _LONGEST_S or (seconds > _WATCHED_S and len(arrivals) >= _LEAST_PICTURES):
                break
    except (av.error.FFmpegError, OSError):
        pass  # it stopped sending: what was received counts
    if picture is None:
        return StreamTrial(error="it was opened, but sends no picture that can be decoded")
    orientation = parse_orientation(picture, pixel_aspect(opened.stream))
    width, height = orientation.size((picture.width, picture.height))
    # Arrivals only where there are no times: what waited in buffers arrives at once.
    times = times if len(times) > 1 else arrivals
    span = times[-1] - times[0]
    fps = (len(times) - 1) / span if len(times) >= _LEAST_PICTURES and span > 0 else 0.0
    return StreamTrial(
        width=width,
        height=height,
        fps=usual_rate(fps) if fps else 0.0,
        codec=opened.stream.codec_context.name,
        gop=order.gop,
        reorders=order.reorders,
        is_upright=not orientation.description,
        kbps=round(8 * size_bytes / span / 1000) if span > 0 else 0.0,
        has_sound=bool(opened.container.streams.audio),
        picture=_jpeg(orientation.image(picture)),
    )


class _PictureOrder:
    """Measures GOPs, and whether pictures are reordered."""

    def __init__(self, opened: OpenedVideo) -> None:
        name = opened.stream.codec_context.name
        self._codec = next((codec for codec in (H264, H265) if codec.ffmpeg_name == name), None)
        self._count, self._keys = 0, list[int]()
        self._newest: int | None = None
        self.reorders = False

    def add(self, packet: av.Packet[VideoStream]) -> None:
        """Add the next access unit."""
        if not packet.size or self._codec is None:
            return
        with contextlib.suppress(ValueError):  # a damaged one
            packing = parse_packing(packet.stream.codec_context.extradata, self._codec)
            if self._codec.is_keyframe(nal_units(packing.annex_b(bytes(packet)))):
                self._keys.append(self._count)
        self._count += 1
        if packet.pts is not None:
            self.reorders |= self._newest is not None and packet.pts < self._newest
            self._newest = packet.pts

    @property
    def gop(self) -> int:
        """Pictures of a GOP, but for the first, which may be cut short for a new client.

        0: they differ, or none was seen whole.
        """
        lengths = {after - before for before, after in itertools.pairwise(self._keys[1:])}
        last = self._count - self._keys[-1] if self._keys else 0
        length = lengths.pop() if len(lengths) == 1 else 0
        return length if last <= length else 0


def usual_rate(fps: float) -> float:
    """Return the usual rate that a measured one is close to, else the measured one with one decimal."""
    nearest = min(_RATES, key=lambda rate: abs(rate - fps))
    return float(nearest) if abs(nearest / fps - 1) < _NEARLY else round(fps, 1)


def _jpeg(image: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> bytes:
    height, width = image.shape[:2]
    if width > _PICTURE_WIDTH:
        size = (_PICTURE_WIDTH, max(1, round(height * _PICTURE_WIDTH / width)))
        image = scale_image(image, size)
    is_encoded, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return np.asarray(jpeg).tobytes() if is_encoded else b""
