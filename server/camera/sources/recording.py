"""A recorded video, replayed on the pulses according to its frames' times."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from typing import Literal

from av.video.frame import VideoFrame

from server.camera.sources.base import Image, SourceEndedError
from server.camera.sources.frame_reader import TimedFrame, read_frames
from server.camera.sources.frame_timing import frame_count, frame_index
from server.camera.sources.missing_frames import MissingFrames
from server.camera.sources.opening import open_video
from server.camera.sources.orientation import INTERLACED, parse_orientation, pixel_aspect
from server.config.source_address import path_is_missing
from server.media.letterbox import Letterbox
from server.system.address_redaction import redact_to_host
from server.system.errors import UserError

log = logging.getLogger(__name__)

SAME_RATE = 0.001
"""Relative difference below which two rates count as equal: 29.97 is 30 in round numbers."""
_MAX_NUMBERS = 10_000
"""Pulses whose frame numbers are kept; more than tracking can lag."""


class Recording:
    """Returns at pulse ``offset + n`` the frame that is shown ``n / fps`` seconds after the first one.

    That is the newest frame due by then, within half a frame interval; at equal rates it is frame ``n``. So
    recorded views stay aligned at any rate and load.

    A damaged or missing frame is replaced by the previous one, so that later ones keep their time; this is
    logged at the end. Images are upright, with square pixels, and letterboxed to the size of the first one.

    Args:
        path: the file.
        offset: the pulse of its first frame.
        at_end: whether it stops or loops.
        fps: pulses a second; None: the recording's own rate.
        quiet: log no warnings about the file.

    Raises:
        UserError: there is no such file, no video in it, or no frame that can be decoded.
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
            raise UserError(f"{redact_to_host(path)}: no such file or folder")
        self._path, self._offset, self._loop = path, offset, at_end == "loop"
        self._quiet = quiet
        self._opened = open_video(path)
        self._aspect = pixel_aspect(self._opened.stream)
        self.fps = self._opened.fps
        """The declared frame rate."""
        self.frames = self._opened.frames
        """The declared number of frames; 0: not declared."""
        self._site_fps = fps or self.fps
        self._same_rate = abs(self.fps / self._site_fps - 1) <= SAME_RATE
        self._missing_frames: MissingFrames | None = None if quiet else MissingFrames(path)
        self._length: int | None = None
        """Its length in pulses; None: unknown until its end."""
        self._number_offsets: dict[int, int] = {}
        """By pulse: the number of the shown frame minus its position, where they differ."""
        self._begin()
        try:
            first = self._forward(0)  # a broken file is rejected now, not at the first pulse
        except SourceEndedError:
            self._missing_frames = None  # all of it is damaged
            self.close()
            raise UserError(
                f"{redact_to_host(path)}: this video has no frames; is the file complete?"
            ) from None
        self.orientation = parse_orientation(first, self._aspect)
        """The orientation of the first frame."""
        self.size = self.orientation.size((first.width, first.height))
        self._resized = quiet
        """Whether a change of size was logged."""
        if not quiet:
            self._log_warnings(first)

    def take(self, pulse: int) -> Image | None:
        """Return the image of a pulse; None before the recording begins."""
        index = pulse - self._offset
        if index < 0:
            return None
        try:
            position = self._position(index)
            picture = self._forward(position)
        except SourceEndedError:
            self._log_missing_frames()
            if not self._loop or not self._length:
                raise
            position = self._position(index)
            picture = self._forward(position)
        self._record_number(pulse, index, position)
        return self._shown(picture)

    def pulse_by_frame_count(self, pulse: int) -> int:
        """Return the pulse of this pulse's frame if frames were counted, one per pulse, and not repeated."""
        return pulse + self._number_offsets.get(pulse, 0)

    def pulse_in_first_pass(self, pulse: int) -> int:
        """Return the pulse at which the frame of a pulse is shown first, if it loops."""
        index = pulse - self._offset
        return pulse if index < 0 or not self._length else self._offset + index % self._length

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        """Decode the frames with these indices, from a second reader of the file."""
        return decode_frames(self._path, indices, self._site_fps)

    def close(self) -> None:
        """Close the file."""
        self._log_missing_frames()
        self._opened.container.close()

    def _begin(self) -> None:
        again = self._quiet or self._length is not None
        self._pictures = read_frames(self._opened, quiet=again)
        self._upcoming: TimedFrame | None = None
        self._newest: VideoFrame | None = None
        self._at = self._number = self._requested = -1
        """The newest frame's position and number, and the last requested position."""
        self._seconds = 0.0

    def _position(self, index: int) -> int:
        """Return the position of an index, modulo the length of a loop; rewind if needed."""
        if self._length is not None:
            if index >= self._length and not self._loop:
                raise SourceEndedError(self._path)
            index %= self._length
        if index < self._requested:
            self._opened.container.close()
            self._opened = open_video(self._path)
            self._begin()
        return index

    def _forward(self, position: int) -> VideoFrame:
        """Decode up to the frame shown at a position, and return it."""
        self._requested = position
        while (upcoming := self._upcoming or next(self._pictures, None)) is not None:
            at = frame_index(upcoming.seconds, self._site_fps)
            # A damaged beginning is replaced by the first intact frame.
            if at > position and self._newest is not None:
                self._upcoming = upcoming
                break
            self._upcoming = None
            self._advance(at, upcoming)
        else:
            self._end()
        if self._newest is None or (self._length is not None and position >= self._length):
            raise SourceEndedError(self._path)
        return self._newest

    def _advance(self, at: int, upcoming: TimedFrame) -> None:
        """Make the file's next frame, at a position, the newest one."""
        self._number += 1
        self._seconds = max(self._seconds, upcoming.seconds)
        missing = self._missing_frames if self._length is None else None
        if missing is not None and upcoming.picture is None:
            missing.add_damaged(at)
        if missing is not None and self._same_rate:
            missing.add_missing(range(self._at + 1, at))
        self._at = max(self._at, at)
        self._newest = upcoming.picture or self._newest

    def _end(self) -> None:
        if self._length is None and self._newest is not None:
            self._length = frame_count(self._seconds, self.fps, self._site_fps)

    def _record_number(self, pulse: int, index: int, position: int) -> None:
        offset = position - index + (self._number - position if self._at <= position else 0)
        if offset:
            self._number_offsets[pulse] = offset
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
                "%s: its images are %dx%d from frame %d on, they were %dx%d: letterboxed to that size",
                *(redact_to_host(self._path), *size, self._requested + 1, *self.size),
            )
        return Letterbox(size, self.size).image(image)

    def _log_warnings(self, first: VideoFrame) -> None:
        if self._opened.video_streams > 1:
            log.warning(
                "%s contains %d video streams: the first is used",
                redact_to_host(self._path),
                self._opened.video_streams,
            )
        if first.interlaced_frame:
            log.warning("%s: %s", redact_to_host(self._path), INTERLACED)
        if not self._same_rate:
            effect = "dropped" if self.fps > self._site_fps else "repeated"
            log.warning(
                "%s has %.4g frames a second, the site %.4g: frames keep their times, some are %s",
                *(redact_to_host(self._path), self.fps, self._site_fps, effect),
            )

    def _log_missing_frames(self) -> None:
        if self._missing_frames is not None:
            length = self._at + 1
            self._missing_frames.log_summary(
                length, self._number / self._seconds if self._seconds else self.fps
            )


def decode_frames(path: str, indices: Sequence[int], fps: float | None = None) -> Iterator[Image]:
    """Decode the frames of a file with ascending indices; fewer where the file is shorter.

    Raises:
        UserError: it cannot be opened.
    """
    recording = Recording(path, fps=fps, quiet=True)
    try:
        for index in indices:
            image = recording.take(index)
            if image is not None:
                yield image
    except SourceEndedError:
        return
    finally:
        recording.close()
