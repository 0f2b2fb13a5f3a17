"""Pictures from the colours of a codec to BGR, and back."""

from __future__ import annotations

import threading

import av
import numpy as np
from av.video.frame import VideoFrame
from av.video.reformatter import Colorspace, VideoReformatter
from numpy.typing import NDArray


class _Kept(threading.local):
    """What converts, kept from picture to picture: to set it up takes as long as many a picture does."""

    def __init__(self) -> None:
        self.to_bgr, self.to_yuv = VideoReformatter(), VideoReformatter()


_kept = _Kept()
_THREADS = 1
"""FFmpeg would take one for each core, for a fraction of a millisecond's work."""


def to_bgr(picture: VideoFrame) -> NDArray[np.uint8]:
    """Return a decoded picture as ``(height, width, 3)`` BGR.

    One that names colours which FFmpeg cannot convert (ITU-T H.273, 8.3: half of the numbers there are) is
    shown by BT.601: whoever names them mostly did not mean to.
    """
    try:
        found = _kept.to_bgr.reformat(picture, format="bgr24", threads=_THREADS)
    except av.FFmpegError:
        found = _kept.to_bgr.reformat(
            picture, format="bgr24", threads=_THREADS, src_colorspace=Colorspace.ITU601
        )
    return np.asarray(found.to_ndarray(), dtype=np.uint8)


def to_yuv(image: NDArray[np.uint8]) -> VideoFrame:
    """Return a picture, ``(height, width, 3)`` BGR, as it is encoded: colour at half the size."""
    picture = VideoFrame.from_ndarray(image, format="bgr24")
    return _kept.to_yuv.reformat(picture, format="yuv420p", threads=_THREADS)
