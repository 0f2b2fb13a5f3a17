"""Renders one stream: decodes it once for JPEG pictures with and without boxes, and a video with boxes."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import av
import cv2
import numpy as np
from av.video.codeccontext import VideoCodecContext
from av.video.frame import VideoFrame

from server.camera.encoder import Encoder
from server.media.color_conversion import to_bgr
from server.media.rendering_messages import (
    WHOLE_PICTURE,
    EncodedFrame,
    JpegPicture,
    PictureKind,
    Region,
    RenderRequest,
    RenderResult,
    RenderSettings,
    is_at_rate,
)
from server.messaging.number_types import PULSE_MAX
from server.service.rendering.worker.box_overlay import Image, draw_boxes
from server.service.rendering.worker.demuxers import demux_mp4, demux_webm
from server.service.rendering.worker.pixelation import RegionMemory, pixelate

log = logging.getLogger(__name__)


@dataclass
class DecodedFrame:
    """One decoded frame; its images are converted when first needed."""

    pulse: int
    duration: int
    frame: VideoFrame
    boxes: Sequence[tuple[int, float, float, float, float]]
    chosen: int | None
    hidden: Sequence[Region] = ()
    """The regions to pixelate."""

    @cached_property
    def plain(self) -> Image:
        """The image, ``(height, width, 3)`` BGR, with the hidden regions pixelated."""
        image = to_bgr(self.frame)
        return pixelate(image, self.hidden) if self.hidden else image

    @cached_property
    def boxed(self) -> Image:
        """The image with boxes."""
        image = self.plain.copy()
        draw_boxes(image, self.boxes, self.chosen)
        return image


class StreamRenderer:
    """Answers the render requests of one stream."""

    def __init__(self, settings: RenderSettings) -> None:
        self._settings = settings
        self._decoder = _decoder(settings.input_codec)
        self._is_decodable = False
        """Whether no frame has been damaged since the last keyframe."""
        self._has_warned = False
        self._encoder: Encoder | None = None
        self._encoded_last = -1
        self._last: DecodedFrame | None = None
        self._regions = RegionMemory()

    def render(self, request: RenderRequest) -> RenderResult:
        """Decode the frames and return the requested outputs."""
        fps = self._settings.fps
        video: list[EncodedFrame] = []
        plain: list[JpegPicture] = []
        boxed: list[JpegPicture] = []
        for picture in self._decode(request):
            self._last, pulse = picture, picture.pulse
            if request.video is not None:
                video.append(self._encode(picture, request.video))
            if any(is_at_rate(pulse, rate, fps) for rate in request.plain):
                plain.append(self._jpeg(pulse, picture.plain))
            if any(is_at_rate(pulse, rate, fps) for rate in request.boxed):
                boxed.append(self._jpeg(pulse, picture.boxed))
        newest = -1 if self._last is None else self._last.pulse
        return RenderResult(newest=newest, video=video, plain=plain, boxed=boxed, still=self._still(request))

    def _still(self, request: RenderRequest) -> JpegPicture | None:
        if request.still is None or self._last is None:
            return None
        image = self._last.boxed if request.still == "boxed" else self._last.plain
        return self._jpeg(self._last.pulse, image)

    def _decode(self, request: RenderRequest) -> Iterator[DecodedFrame]:
        demux = demux_webm if self._settings.input_codec == "vp8" else demux_mp4
        for demuxed in demux(request.fragments, self._settings.fps):
            is_valid = bool(demuxed.data) and demuxed.pulse <= PULSE_MAX  # an empty packet would flush
            self._is_decodable = (self._is_decodable or demuxed.key) and is_valid
            if not self._is_decodable:
                continue
            packet = av.Packet(demuxed.data)
            packet.pts = packet.dts = demuxed.pulse
            try:
                pictures = self._decoder.decode(packet)
            except av.FFmpegError as error:
                if not self._has_warned:  # there may be one in every GOP
                    text = "frame %d cannot be decoded: %s; further ones are not logged"
                    log.warning(text, demuxed.pulse, error)
                self._has_warned = True
                self._decoder, self._is_decodable = _decoder(self._settings.input_codec), False
                continue
            for frame in pictures:
                pulse = demuxed.pulse if frame.pts is None else frame.pts
                place = pulse - request.first
                boxes = request.boxes[place] if 0 <= place < len(request.boxes) else []
                hidden = self._hidden(frame, place, request.hidden)
                yield DecodedFrame(pulse, demuxed.duration, frame, boxes, request.chosen, hidden)

    def _hidden(
        self, frame: VideoFrame, place: int, hidden: Sequence[Sequence[Region]] | None
    ) -> Sequence[Region]:
        if hidden is None:
            return ()
        return self._regions.regions_in(frame, hidden[place] if 0 <= place < len(hidden) else [WHOLE_PICTURE])

    def _encode(self, picture: DecodedFrame, kind: PictureKind) -> EncodedFrame:
        if self._encoder is None or picture.pulse <= self._encoded_last:  # the pulses have restarted
            self._encoder = Encoder(self._settings, self._settings)
        self._encoded_last = picture.pulse
        unit = self._encoder.encode(picture.pulse, picture.boxed if kind == "boxed" else picture.plain)
        return EncodedFrame(unit.pulse, unit.key, unit.data, picture.duration)

    def _jpeg(self, pulse: int, image: Image) -> JpegPicture:
        _, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, self._settings.jpeg_quality])
        return JpegPicture(pulse, np.asarray(jpeg).tobytes())


def _decoder(codec: str) -> VideoCodecContext:
    decoder = av.CodecContext.create("hevc" if codec == "h265" else codec, "r")
    assert isinstance(decoder, VideoCodecContext)  # noqa: S101 — for mypy
    decoder.thread_count = 1  # more threads delay frames
    return decoder
