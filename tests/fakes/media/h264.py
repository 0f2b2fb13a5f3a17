"""H.264 streams of various encoder settings."""

from __future__ import annotations

import av
import numpy as np
from numpy.typing import NDArray

from server.camera.encoder import AccessUnit, Encoder
from server.config.sections import EncodeSettings, SiteSettings
from server.media.h264.annexb import parameter_sets
from server.media.h264.repeat_picture import SliceHeaderFormat, parse_repeatable
from server.media.nal_units import nal_units

PRESETS = ("ultrafast", "superfast", "medium")


def encoded(size: tuple[int, int], preset: str, frames: int, gop: int = 6) -> list[AccessUnit]:
    encoder = Encoder(
        SiteSettings(width=size[0], height=size[1], fps=25), EncodeSettings(gop_s=gop / 25, preset=preset)
    )  # type: ignore[arg-type]
    noise = np.random.default_rng(0).integers(0, 255, (frames, size[1], size[0], 3), dtype=np.uint8)
    return [encoder.encode(pulse, np.asarray(picture // 4 * 2)) for pulse, picture in enumerate(noise)]


def slice_header_format(unit: AccessUnit) -> SliceHeaderFormat:
    parameters = parameter_sets(nal_units(unit.data))
    assert parameters is not None
    return parse_repeatable(parameters)


def decoded(samples: list[bytes]) -> list[NDArray[np.uint8]]:
    """Decode length-prefixed samples; damaged data is an error."""
    decoder = av.CodecContext.create("h264", "r")
    decoder.options = {"err_detect": "explode"}
    pictures = []
    for data in [*samples, None]:
        pictures += decoder.decode(None if data is None else av.Packet(annex_b(data)))
    return [picture.to_ndarray(format="yuv420p") for picture in pictures]


def annex_b(data: bytes) -> bytes:
    out, at = b"", 0
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        out += b"\x00\x00\x00\x01" + data[at + 4 : at + 4 + length]
        at += 4 + length
    return out
