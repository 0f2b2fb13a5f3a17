"""One stream, decoded once: pictures of it with and without boxes, and a film with boxes."""

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

from server.camera.encoding.encoder import Encoder
from server.media.color_conversion import to_bgr
from server.media.rendering_messages import (
    Canvas,
    EncodedFrame,
    JpegPicture,
    RenderRequest,
    RenderResult,
    is_in_series,
)
from server.messaging.number_types import PULSE_MAX
from server.service.rendering.worker.box_overlay import Image, draw_boxes
from server.service.rendering.worker.demuxers import demux_mp4, demux_webm

log = logging.getLogger(__name__)


@dataclass
class DecodedPicture:
    """One decoded frame; what is not asked for is not made."""

    pulse: int
    lasts: int
    frame: VideoFrame
    boxes: Sequence[tuple[int, float, float, float, float]]
    chosen: int | None

    @cached_property
    def plain(self) -> Image:
        """The picture, ``(height, width, 3)`` BGR."""
        return to_bgr(self.frame)

    @cached_property
    def boxed(self) -> Image:
        """The picture with its own boxes."""
        image = self.plain.copy()
        draw_boxes(image, self.boxes, self.chosen)
        return image


class StreamRenderer:
    """Answers requests about one stream."""

    def __init__(self, canvas: Canvas) -> None:
        self._canvas = canvas
        self._decoder = _decoder(canvas.codec)
        self._whole = False
        """What comes can be decoded: nothing has been damaged since the last key frame."""
        self._told = False
        """That something could not be decoded."""
        self._encoder: Encoder | None = None
        self._encoded_last = -1
        self._last: DecodedPicture | None = None

    def draw(self, request: RenderRequest) -> RenderResult:
        """Decode the frames and give what is wanted of them."""
        fps = self._canvas.fps
        film: list[EncodedFrame] = []
        plain: list[JpegPicture] = []
        boxed: list[JpegPicture] = []
        for painting in self._paintings(request):
            self._last, pulse = painting, painting.pulse
            if request.film:
                film.append(self._encoded(painting))
            if any(is_in_series(pulse, rate, fps) for rate in request.plain):
                plain.append(self._jpeg(pulse, painting.plain))
            if any(is_in_series(pulse, rate, fps) for rate in request.boxed):
                boxed.append(self._jpeg(pulse, painting.boxed))
        newest = -1 if self._last is None else self._last.pulse
        return RenderResult(newest=newest, film=film, plain=plain, boxed=boxed, still=self._still(request))

    def _still(self, request: RenderRequest) -> JpegPicture | None:
        if request.still is None or self._last is None:
            return None
        image = self._last.boxed if request.still == "boxed" else self._last.plain
        return self._jpeg(self._last.pulse, image)

    def _paintings(self, request: RenderRequest) -> Iterator[DecodedPicture]:
        unpack = demux_webm if self._canvas.codec == "vp8" else demux_mp4
        for unit in unpack(request.fragments, self._canvas.fps):
            good = bool(unit.data) and unit.pulse <= PULSE_MAX  # no data would mean the end
            self._whole = (self._whole or unit.key) and good
            if not self._whole:
                continue
            packet = av.Packet(unit.data)
            packet.pts = packet.dts = unit.pulse
            try:
                pictures = self._decoder.decode(packet)
            except av.FFmpegError as error:
                if not self._told:  # there may be one in every GOP
                    log.warning("frame %d cannot be decoded: %s; others are not told of", unit.pulse, error)
                self._told = True
                self._decoder, self._whole = _decoder(self._canvas.codec), False
                continue
            for frame in pictures:
                pulse = unit.pulse if frame.pts is None else frame.pts
                place = pulse - request.first
                boxes = request.boxes[place] if 0 <= place < len(request.boxes) else []
                yield DecodedPicture(pulse, unit.lasts, frame, boxes, request.chosen)

    def _encoded(self, painting: DecodedPicture) -> EncodedFrame:
        if self._encoder is None or painting.pulse <= self._encoded_last:  # it goes back: begun anew
            self._encoder = Encoder(self._canvas, self._canvas)
        self._encoded_last = painting.pulse
        unit = self._encoder.encode(painting.pulse, painting.boxed)
        return EncodedFrame(unit.pulse, unit.key, unit.data, painting.lasts)

    def _jpeg(self, pulse: int, image: Image) -> JpegPicture:
        _, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, self._canvas.jpeg_quality])
        return JpegPicture(pulse, np.asarray(jpeg).tobytes())


def _decoder(codec: str) -> VideoCodecContext:
    decoder = av.CodecContext.create(codec, "r")
    assert isinstance(decoder, VideoCodecContext)  # noqa: S101 — tells mypy what it is
    decoder.thread_count = 1  # or frames are held back
    return decoder
