"""The substream of a network camera: its pictures of the last seconds, by when they were captured."""

from __future__ import annotations

import logging
import threading
from collections.abc import Mapping
from time import monotonic

import av
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from server.camera.sources.opening import OpenedVideo
from server.camera.sources.orientation import parse_orientation, pixel_aspect
from server.camera.sources.stream_clock import CaptureTime
from server.camera.sources.stream_reader import StreamReader
from server.camera.substream.picture_buffer import BufferedPicture, PictureBuffer, PictureRequest
from server.system.address_redaction import redact_to_host

log = logging.getLogger(__name__)

_NOT_KEPT = (
    "%s: pictures of this substream are so %s that only %.1f s of them are kept, and those for a later "
    "main stream may be missing: set it to a %s"
)
_FIRST_PICTURE_S = 4.0
"""Seconds to wait for the first picture: its size decides at which size people are tracked."""


class LiveSubstream(StreamReader):
    """Reads a substream in a thread; connects by itself, also at first: the video never waits for it long."""

    def __init__(self, url: str, options: Mapping[str, str], pictures: PictureBuffer) -> None:
        super().__init__(url, options)
        self._pictures = pictures
        self._aspect, self._has_warned = 1.0, False
        self.size: tuple[int, int] | None = None
        """Width and height of its first picture as displayed; None: there has been none yet."""
        self._sized = threading.Event()
        self._start(None)
        self._sized.wait(_FIRST_PICTURE_S)

    def request(self, captured: CaptureTime) -> PictureRequest:
        """Look for the picture captured at a time."""
        return self._pictures.request(captured)

    def wait(self, request: PictureRequest, until: float) -> BufferedPicture | None:
        """Return a request's picture; see :meth:`PictureBuffer.wait`."""
        return self._pictures.wait(request, until)

    def _accept(self, opened: OpenedVideo) -> bool:
        self._aspect = pixel_aspect(opened.stream)
        return True

    def _decode(self, packet: av.Packet[VideoStream]) -> bool:
        try:
            pictures = [picture for picture in packet.decode() if isinstance(picture, VideoFrame)]
        except av.error.FFmpegError:  # damaged
            return False
        now = monotonic()
        for picture in pictures:
            if self.size is None:
                orientation = parse_orientation(picture, self._aspect)
                self.size = orientation.size((picture.width, picture.height))
                self._sized.set()
            captured = self._clock.at(picture.time, now)
            self._pictures.put(BufferedPicture(picture, self._aspect, captured))
        if self._pictures.kept_s is not None and not self._has_warned:
            self._has_warned = True
            many = self._pictures.is_too_many
            how, wanted = ("many", "lower frame rate") if many else ("large", "smaller size")
            log.warning(_NOT_KEPT, redact_to_host(self._url), how, self._pictures.kept_s, wanted)
        return bool(pictures)
