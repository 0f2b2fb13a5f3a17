"""Selects the stream format of a site by its codec."""

from __future__ import annotations

from server.media.h264.codec import H264
from server.media.h265.codec import H265
from server.media.nal_codec import NalCodec
from server.media.picture import Codec
from server.media.stream_format import PerCameraStreamFormat, StreamFormat
from server.media.vp8.stream_format import Vp8StreamFormat


def nal_codec(codec: Codec) -> NalCodec:
    """Return a codec of NAL units by its name: H.265 or, by default, H.264."""
    return H265 if codec == "h265" else H264


def stream_format_for(
    codec: Codec, size: tuple[int, int], *, per_camera_parameters: bool = False
) -> StreamFormat:
    """Return the stream format of a site.

    ``size`` is (width, height) in pixels. ``per_camera_parameters``: parameter sets may differ among cameras.
    """
    if codec == "vp8":
        return Vp8StreamFormat(*size)
    kind = PerCameraStreamFormat if per_camera_parameters else StreamFormat
    return kind(nal_codec(codec))
