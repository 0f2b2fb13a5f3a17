"""A recorded video, replayed on the pulses by its pictures' times."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from typing import Literal

from av.video.frame import VideoFrame

from server.camera.sources.base import Image, SourceEndedError
from server.camera.sources.frame_reader import TimedPicture, read_pictures
from server.camera.sources.frame_timing import frame_count, frame_index
from server.camera.sources.missing_frames import MissingFrames
from server.camera.sources.opening import open_video
from server.camera.sources.orientation import INTERLACED, parse_orientation, pixel_aspect
from server.config.source_address import path_is_missing
from server.media.letterbox import Letterbox
from server.system.address_redaction import redact_address
from server.system.errors import UserError

log = logging.getLogger(__name__)

SAME_RATE = 0.001
"""Relative difference below which two rates count as equal: 29.97 is 30 in round numbers."""
_MAX_NUMBERS = 10_000
"""Pulses whose picture numbers are remembered; more than tracking can lag."""


class Recording:
    """Shows at pulse ``offset + n`` the picture due ``n / fps`` seconds after the first one.

    That is the newest picture due by then, within half a frame; at equal rates it is picture ``n``. So
    recorded views stay aligned at any rate and load.

    A damaged or missing picture shows as the one before it, so that later ones keep their time; this is
    logged at the end. Pictures are upright, with square pixels, and letterboxed to the first one's size.

    Args:
        path: the file.
        offset: the pulse of its first picture.
        at_end: whether it stops or loops.
        fps: pulses a second; None: the recording's own rate.
        quiet: log no warnings about the file.

    Raises:
        UserError: there is no such file, no video in it, or not one picture that can be decoded.
    """

    recorded = True

    def __init__(
        self,
        path: str,
        offset: int = 0,
        at_end: Literal["stop", "loop"] = "stop",
        fps: float | None = None,
        *,
        quiet: bool = False,
    ) -> None:
        if path_is_missing(path):
            raise UserError(f"{redact_address(path)}: no such file or folder")
        self._path, self._offset, self._loop = path, offset, at_end == "loop"
        self._quiet = quiet
        self._opened = open_video(path)
        self._aspect = pixel_aspect(self._opened.stream)
        self.fps = self._opened.fps
        """The declared pictures a second."""
        self.frames = self._opened.frames
        """The declared number of pictures; 0: not declared."""
        self._site_fps = fps or self.fps
        self._same_rate = abs(self.fps / self._site_fps - 1) <= SAME_RATE
        self._gaps: MissingFrames | None = None if quiet else MissingFrames(path)
        self._length: int | None = None
        """Its length in pulses; None: not known before its end."""
        self._number_offsets: dict[int, int] = {}
        """By pulse: the shown picture's number minus the pulse's position, where they differ."""
        self._begin()
        try:
            first = self._forward(0)  # a broken file is rejected now, not at the first pulse
        except SourceEndedError:
            self._gaps = None  # all of it is damaged
            self.close()
            raise UserError(
                f"{redact_address(path)}: there is not one picture in this video; is the file whole?"
            ) from None
        self.orientation = parse_orientation(first, self._aspect)
        """The first picture's orientation."""
        self.size = self.orientation.size((first.width, first.height))
        self._resized = quiet
        """Whether a change of size was logged."""
        if not quiet:
            self._log_peculiarities(first)

    def take(self, pulse: int) -> Image | None:
        """Return the picture of a pulse; None before the recording begins."""
        index = pulse - self._offset
        if index < 0:
            return None
        try:
            place = self._place(index)
            picture = self._forward(place)
        except SourceEndedError:
            self._log_missing_frames()
            if not self._loop or not self._length:
                raise
            place = self._place(index)
            picture = self._forward(place)
        self._note_number(pulse, place)
        return self._shown(picture)

    def counted_pulse(self, pulse: int) -> int:
        """Return the pulse that this pulse's picture would have if pictures were counted one per pulse."""
        return pulse + self._number_offsets.get(pulse, 0)

    def ahead(self, places: Sequence[int]) -> Iterator[Image]:
        """Decode the frames at some places, from the file opened once more."""
        return decode_frames(self._path, places, self._site_fps)

    def close(self) -> None:
        """Close the file."""
        self._log_missing_frames()
        self._opened.container.close()

    def _begin(self) -> None:
        again = self._quiet or self._length is not None
        self._pictures = read_pictures(self._opened, again=again)
        self._coming: TimedPicture | None = None
        self._newest: VideoFrame | None = None
        self._at = self._number = self._requested = -1
        """The newest picture's position and number, and the last requested position."""
        self._seconds = 0.0

    def _place(self, index: int) -> int:
        """Return the position for an index, modulo the length of a loop; rewind where needed."""
        if self._length is None:
            return index
        if index >= self._length and not self._loop:
            raise SourceEndedError(self._path)
        index %= self._length
        if index < self._requested:
            self._opened.container.close()
            self._opened = open_video(self._path)
            self._begin()
        return index

    def _forward(self, place: int) -> VideoFrame:
        """Decode up to the picture shown at a position."""
        self._requested = place
        while (coming := self._coming or next(self._pictures, None)) is not None:
            at = frame_index(coming.seconds, self._site_fps)
            # If the beginning is damaged, the first good picture stands for it.
            if at > place and self._newest is not None:
                self._coming = coming
                break
            self._coming = None
            self._take_in(at, coming)
        else:
            self._end()
        if self._newest is None or (self._length is not None and place >= self._length):
            raise SourceEndedError(self._path)
        return self._newest

    def _take_in(self, at: int, coming: TimedPicture) -> None:
        """Advance to the file's next picture, which has a position."""
        self._number += 1
        self._seconds = max(self._seconds, coming.seconds)
        noted = self._gaps if self._length is None else None
        if noted is not None and coming.picture is None:
            noted.add_damaged(at)
        if noted is not None and self._same_rate:
            noted.add_missing(range(self._at + 1, at))
        self._at = max(self._at, at)
        self._newest = coming.picture or self._newest

    def _end(self) -> None:
        if self._length is None and self._newest is not None:
            self._length = frame_count(self._seconds, self.fps, self._site_fps)

    def _note_number(self, pulse: int, place: int) -> None:
        moved = self._number - place if self._at <= place else 0
        if moved:
            self._number_offsets[pulse] = moved
            if len(self._number_offsets) > _MAX_NUMBERS:
                del self._number_offsets[next(iter(self._number_offsets))]

    def _shown(self, picture: VideoFrame) -> Image:
        image = parse_orientation(picture, self._aspect).image(picture)
        size = image.shape[1], image.shape[0]
        if size == self.size:
            return image
        if not self._resized:
            self._resized = True
            log.warning(
                "%s: its pictures are %dx%d from frame %d on, they were %dx%d: they are fitted into that",
                *(redact_address(self._path), *size, self._requested + 1, *self.size),
            )
        return Letterbox(size, self.size).image(image)

    def _log_peculiarities(self, first: VideoFrame) -> None:
        if self._opened.videos > 1:
            log.warning(
                "%s: there are %d videos in it: the first is taken",
                redact_address(self._path),
                self._opened.videos,
            )
        if first.interlaced_frame:
            log.warning("%s: %s", redact_address(self._path), INTERLACED)
        if not self._same_rate:
            some = "left out" if self.fps > self._site_fps else "shown twice"
            log.warning(
                "%s: it has %.4g pictures a second, %.4g are taken: each is shown at its time, some are %s",
                *(redact_address(self._path), self.fps, self._site_fps, some),
            )

    def _log_missing_frames(self) -> None:
        if self._gaps is not None:
            length = self._at + 1
            self._gaps.log_summary(length, self._number / self._seconds if self._seconds else self.fps)


def decode_frames(path: str, places: Sequence[int], fps: float | None = None) -> Iterator[Image]:
    """Decode frames of a file at ascending positions; fewer where the file is shorter.

    Raises:
        UserError: it cannot be opened.
    """
    recording = Recording(path, fps=fps, quiet=True)
    try:
        for place in places:
            image = recording.take(place)
            if image is not None:
                yield image
    except SourceEndedError:
        return
    finally:
        recording.close()
