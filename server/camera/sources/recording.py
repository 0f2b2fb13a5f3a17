"""A recorded video, replayed frame by frame on the pulses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

from av.video.frame import VideoFrame

from server.camera.sources.base import Image, SourceEnded
from server.camera.sources.opening import open_video
from server.camera.sources.pictures import pictures
from server.wire.addresses import shown
from server.wire.colours import bgr
from server.wire.errors import UserError
from server.wire.sources import is_missing


class Recording:
    """Shows its frame ``pulse - offset``: recorded views stay aligned however busy the machine is.

    A damaged packet shows as the picture before it, so that what follows keeps its place.

    Raises:
        UserError: there is no such file, no video in it, or not one picture that can be decoded.
    """

    recorded = True

    def __init__(self, path: str, offset: int, at_end: Literal["stop", "loop"]) -> None:
        if is_missing(path):
            raise UserError(f"{shown(path)}: no such file or folder")
        self._path, self._offset, self._loop = path, offset, at_end == "loop"
        self._opened = open_video(path)
        self.size = self._opened.size
        self.fps = self._opened.fps
        self.frames = self._opened.frames
        """How many frames the file says it has; 0 where it does not say."""
        self._pictures = pictures(self._opened)
        self._next = 0
        self._length: int | None = None
        self._newest: VideoFrame | None = None
        try:
            self._forward(0)  # a broken file is refused now, not at its first pulse
        except SourceEnded:
            self.close()
            raise UserError(
                f"{shown(path)}: there is not one picture in this video; is the file whole?"
            ) from None

    def take(self, pulse: int) -> Image | None:
        """Give frame ``pulse - offset``; None before the recording begins."""
        index = pulse - self._offset
        if index < 0:
            return None
        if self._length is not None:
            index = self._place(index)
        try:
            return self._forward(index)
        except SourceEnded:
            if not self._loop or not self._length:
                raise
            return self._forward(self._place(index))

    def ahead(self, places: Sequence[int]) -> Iterator[Image]:
        """Decode the frames at some places, from the file opened once more."""
        return frames_at(self._path, places)

    def _place(self, index: int) -> int:
        """Give the frame that stands at ``index`` of a recording that repeats, rewound if need be."""
        if not self._loop or not self._length:
            raise SourceEnded(self._path)
        index %= self._length
        if index < self._next - 1:
            self._rewind()
        return index

    def _rewind(self) -> None:
        self._opened.container.close()
        self._opened = open_video(self._path)
        self._pictures, self._next, self._newest = pictures(self._opened, again=True), 0, None

    def _forward(self, index: int) -> Image:
        """Decode up to frame ``index``."""
        # Damaged from the start: what comes before the first good picture shows as that one.
        while self._next <= index or self._newest is None:
            try:
                picture = next(self._pictures)
            except StopIteration:
                self._length = self._next
                raise SourceEnded(self._path) from None
            self._newest = picture or self._newest
            self._next += 1
        return bgr(self._newest)

    def close(self) -> None:
        """Close the file."""
        self._opened.container.close()


def frames_at(path: str, places: Sequence[int]) -> Iterator[Image]:
    """Give the frames at some places of a file, by rising place; fewer where it is shorter.

    Raises:
        UserError: it cannot be opened.
    """
    recording = Recording(path, offset=0, at_end="stop")
    try:
        for place in places:
            image = recording.take(place)
            if image is not None:
                yield image
    except SourceEnded:
        return
    finally:
        recording.close()
