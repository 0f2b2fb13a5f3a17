"""Disturbances on the way from the sensor: codecs, lost and repeated frames, a frozen picture."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import av
import cv2
import numpy as np

from benchmarks.robustness.disturbances.base import Disturbance, Effect, Floats, Moment
from server.camera.sources import Image


@dataclass(frozen=True)
class Jpeg(Disturbance):
    """Pictures compressed one by one."""

    quality: int
    """Of libjpeg, 1 to 100."""

    def apply(self, image: Image, moment: Moment) -> Image:
        """Compress and decompress."""
        del moment
        _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, self.quality])
        return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=np.uint8)


@dataclass(frozen=True)
class LowRateH264(Disturbance):
    """H.264 of constant quality, as of a camera with too low a bit rate."""

    crf: int
    """Of x264: 23 is usual, 51 the worst."""
    keyframe_every: int = 50

    def begin(self) -> Effect:
        """Return an encoder and a decoder without delay."""
        return _H264RoundTrip(self.crf, self.keyframe_every)


class _H264RoundTrip:
    """Encodes and decodes picture by picture."""

    def __init__(self, crf: int, keyframe_every: int) -> None:
        self._options = {"crf": str(crf), "preset": "veryfast", "tune": "zerolatency"}
        self._gop = keyframe_every
        self._encoder: av.VideoCodecContext | None = None
        self._decoder = av.VideoCodecContext.create("h264", "r")
        self._decoder.thread_count = 1

    def __call__(self, image: Image, moment: Moment) -> Image:
        encoder = self._encoder or self._open(image)
        picture = av.VideoFrame.from_ndarray(image, format="bgr24").reformat(format="yuv420p")
        picture.pts = moment.frame
        decoded = [frame for packet in encoder.encode(picture) for frame in self._decoder.decode(packet)]
        if not decoded:  # the decoder waits for a second picture
            return image
        return np.asarray(decoded[-1].to_ndarray(format="bgr24"), dtype=np.uint8)

    def _open(self, image: Image) -> av.VideoCodecContext:
        encoder = av.VideoCodecContext.create("libx264", "w")
        encoder.height, encoder.width = image.shape[:2]
        encoder.pix_fmt, encoder.gop_size, encoder.max_b_frames = "yuv420p", self._gop, 0
        encoder.time_base, encoder.framerate = Fraction(1, 25), Fraction(25)
        encoder.thread_count, encoder.options = 1, self._options
        self._encoder = encoder
        return encoder


@dataclass(frozen=True)
class DroppedFrames(Disturbance):
    """Frames that never arrive, alone and several in a row."""

    share: float
    longest_s: float = 0.4
    """Length of the longest gap."""

    def apply(self, image: Image, moment: Moment) -> Image | None:
        """Return the picture, or None in a gap."""
        slot = int(moment.seconds / self.longest_s)
        draw = np.random.default_rng([moment.seed, moment.camera, slot])
        begin, length = draw.random(2)
        place = moment.seconds / self.longest_s - slot
        # Gaps of twice the share's mean length in a slot, or the whole slot.
        lost = begin * (1.0 - self.share) <= place < begin * (1.0 - self.share) + 2.0 * self.share * length
        return None if lost else image


@dataclass(frozen=True)
class DoubledFrames(Disturbance):
    """Frames in whose place the one before comes again."""

    share: float

    def begin(self) -> Effect:
        """Return what remembers the frame before."""
        shown: list[Image] = []

        def repeat(image: Image, moment: Moment) -> Image:
            if not shown or moment.random("double").random() >= self.share:
                shown[:] = [image]
            return shown[0]

        return repeat


@dataclass(frozen=True)
class Frozen(Disturbance):
    """The picture of the beginning, again and again."""

    def begin(self) -> Effect:
        """Return what remembers the first picture."""
        first: list[Image] = []

        def freeze(image: Image, moment: Moment) -> Image:
            del moment
            if not first:
                first.append(image)
            return first[0]

        return freeze

    def cover(self, moment: Moment, size: tuple[int, int]) -> Floats:
        """Return ones: nothing of the scene can be seen."""
        del moment
        return np.ones(size[::-1], dtype=np.float32)
