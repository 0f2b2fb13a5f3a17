"""H.265 streams of various encoder settings."""

from __future__ import annotations

from fractions import Fraction

import av
import numpy as np
from av.video.codeccontext import VideoCodecContext
from av.video.frame import PictureType
from numpy.typing import NDArray

from server.media.h265.parameter_sets import H265ParameterSets, parameter_sets
from server.media.nal_units import nal_units, split_sample

DEPTH_10 = "yuv420p10le"


def x265_units(
    size: tuple[int, int],
    frames: int,
    parameters: str = "",
    preset: str = "ultrafast",
    pixels: str = "yuv420p",
    seed: int = 0,
) -> list[bytes]:
    """Encode one GOP of moving noise; ``parameters`` are x265's."""
    context = av.CodecContext.create("libx265", "w")
    assert isinstance(context, VideoCodecContext)
    context.width, context.height, context.pix_fmt = *size, pixels
    context.time_base, context.framerate = Fraction(1, 25), Fraction(25)
    common = "repeat-headers=1:scenecut=0:open-gop=0:bframes=0:pools=2:frame-threads=1:log-level=none"
    context.options = {
        "preset": preset,
        "tune": "zerolatency",
        "forced-idr": "1",
        "x265-params": f"{common}:{parameters}",
    }
    noise = np.random.default_rng(seed).integers(0, 200, (size[1], size[0], 3), dtype=np.uint8)
    units = []
    for number in range(frames):
        frame = av.VideoFrame.from_ndarray(np.roll(noise, 3 * number, 1), format="bgr24")
        frame = frame.reformat(format=pixels)
        frame.pts, frame.time_base = number, Fraction(1, 25)
        frame.pict_type = PictureType.NONE if number else PictureType.I
        units += [bytes(packet) for packet in context.encode(frame)]
    return [*units, *(bytes(packet) for packet in context.encode(None))]


def sets_of(unit: bytes) -> H265ParameterSets:
    """Return the parameter sets of a keyframe."""
    found = parameter_sets(nal_units(unit))
    assert found is not None
    return found


def decoded_h265(samples: list[bytes]) -> list[NDArray[np.generic]]:
    """Decode length-prefixed samples; damaged data is an error."""
    decoder = av.CodecContext.create("hevc", "r")
    assert isinstance(decoder, VideoCodecContext)
    decoder.options = {"err_detect": "explode"}
    pictures = []
    for sample in [*samples, None]:
        packet = None
        if sample is not None:
            packet = av.Packet(b"".join(b"\x00\x00\x00\x01" + unit for unit in split_sample(sample)))
        pictures += decoder.decode(packet)
    return [picture.to_ndarray() for picture in pictures]
