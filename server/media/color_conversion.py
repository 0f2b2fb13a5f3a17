"""Converts decoded pictures to BGR, and BGR pictures to YUV for encoding."""

from __future__ import annotations

import threading

import av
import numpy as np
from av.video.frame import VideoFrame
from av.video.reformatter import Colorspace, VideoReformatter
from numpy.typing import NDArray


class _Reformatters(threading.local):
    """FFmpeg's converters, one set per thread: creating one takes as long as converting many pictures."""

    def __init__(self) -> None:
        self.to_bgr, self.to_yuv = VideoReformatter(), VideoReformatter()


_reformatters = _Reformatters()
_THREADS = 1
"""Otherwise FFmpeg would start a thread per core, for a fraction of a millisecond of work."""


def to_bgr(picture: VideoFrame) -> NDArray[np.uint8]:
    """Return a decoded picture as ``(height, width, 3)`` BGR.

    A picture with a color space that FFmpeg cannot convert (half of the codes of ITU-T H.273, 8.3) is
    converted by BT.601: such a code is mostly an error.
    """
    try:
        converted = _reformatters.to_bgr.reformat(picture, format="bgr24", threads=_THREADS)
    except av.FFmpegError:
        converted = _reformatters.to_bgr.reformat(
            picture, format="bgr24", threads=_THREADS, src_colorspace=Colorspace.ITU601
        )
    return np.asarray(converted.to_ndarray(), dtype=np.uint8)


def to_yuv(image: NDArray[np.uint8]) -> VideoFrame:
    """Return an image, ``(height, width, 3)`` BGR, as YUV 4:2:0 for an encoder."""
    picture = VideoFrame.from_ndarray(image, format="bgr24")
    return _reformatters.to_yuv.reformat(picture, format="yuv420p", threads=_THREADS)
