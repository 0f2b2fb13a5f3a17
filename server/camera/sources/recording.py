"""A recorded video, replayed on the pulses by the times of its pictures."""

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
"""Part by which a rate may be off another one and nobody has to be told: 29.97 is 30 in round numbers."""
_MOST_COUNTED = 10_000
"""Pulses whose pictures' own numbers are remembered: tracking is not that far behind."""


class Recording:
    """Shows at pulse ``offset + n`` what it shows ``n / fps`` seconds after its first picture.

    That is the newest picture that is due then, give or take half a frame. So recorded views stay aligned
    whatever their rates are and however busy the machine is. Where pictures come one for each pulse that is
    picture ``n``.

    A picture that is damaged or missing shows as the one before it, so that what follows keeps its place; at
    the end that is said. Pictures are upright, their pixels square, and all of the first one's size.

    Args:
        path: the file.
        offset: pulses by which it begins later.
        at_end: whether it begins again.
        fps: pulses a second; None: as many as it has pictures.
        quiet: nothing is said of what is odd about it: somebody else does.

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
        """Pictures a second, as the file says."""
        self.frames = self._opened.frames
        """How many pictures the file says it has; 0 where it does not say."""
        self._site_fps = fps or self.fps
        self._same_rate = abs(self.fps / self._site_fps - 1) <= SAME_RATE
        self._gaps: MissingFrames | None = None if quiet else MissingFrames(path)
        self._length: int | None = None
        """Pulses that it lasts; None: not known before its end."""
        self._moved: dict[int, int] = {}
        """By pulse, how many pictures further the one shown is than if they were counted, where not none."""
        self._begin()
        try:
            first = self._forward(0)  # a broken file is refused now, not at its first pulse
        except SourceEndedError:
            self._gaps = None  # all of it is damaged
            self.close()
            raise UserError(
                f"{redact_address(path)}: there is not one picture in this video; is the file whole?"
            ) from None
        self.orientation = parse_orientation(first, self._aspect)
        """How its first picture is turned, mirrored and stretched."""
        self.size = self.orientation.size((first.width, first.height))
        self._resized = quiet
        """That its pictures have another size since has been said."""
        if not quiet:
            self._say_what_is_odd(first)

    def take(self, pulse: int) -> Image | None:
        """Return what is shown at a pulse; None before the recording begins."""
        index = pulse - self._offset
        if index < 0:
            return None
        try:
            place = self._place(index)
            picture = self._forward(place)
        except SourceEndedError:
            self._say_gaps()
            if not self._loop or not self._length:
                raise
            place = self._place(index)
            picture = self._forward(place)
        self._note_number(pulse, place)
        return self._shown(picture)

    def counted(self, pulse: int) -> int:
        """Return the pulse at which the picture that was shown at this one stands if pictures are counted."""
        return pulse + self._moved.get(pulse, 0)

    def ahead(self, places: Sequence[int]) -> Iterator[Image]:
        """Decode the frames at some places, from the file opened once more."""
        return decode_frames(self._path, places, self._site_fps)

    def close(self) -> None:
        """Close the file."""
        self._say_gaps()
        self._opened.container.close()

    def _begin(self) -> None:
        again = self._quiet or self._length is not None
        self._pictures = read_pictures(self._opened, again=again)
        self._coming: TimedPicture | None = None
        self._newest: VideoFrame | None = None
        self._at = self._number = self._asked = -1
        """The newest picture's place, its number, and the place that was asked for last."""
        self._seconds = 0.0

    def _place(self, index: int) -> int:
        """Return the place that stands at ``index`` of a recording that repeats, rewound if need be."""
        if self._length is None:
            return index
        if index >= self._length and not self._loop:
            raise SourceEndedError(self._path)
        index %= self._length
        if index < self._asked:
            self._opened.container.close()
            self._opened = open_video(self._path)
            self._begin()
        return index

    def _forward(self, place: int) -> VideoFrame:
        """Decode up to what is shown at a place."""
        self._asked = place
        while (coming := self._coming or next(self._pictures, None)) is not None:
            at = frame_index(coming.seconds, self._site_fps)
            # Damaged from the start: what comes before the first good picture shows as that one.
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
        """Go on to the next picture of the file, which stands at a place."""
        self._number += 1
        self._seconds = max(self._seconds, coming.seconds)
        noted = self._gaps if self._length is None else None
        if noted is not None and coming.picture is None:
            noted.damaged(at)
        if noted is not None and self._same_rate:
            noted.missing(range(self._at + 1, at))
        self._at = max(self._at, at)
        self._newest = coming.picture or self._newest

    def _end(self) -> None:
        if self._length is None and self._newest is not None:
            self._length = frame_count(self._seconds, self.fps, self._site_fps)

    def _note_number(self, pulse: int, place: int) -> None:
        moved = self._number - place if self._at <= place else 0
        if moved:
            self._moved[pulse] = moved
            if len(self._moved) > _MOST_COUNTED:
                del self._moved[next(iter(self._moved))]

    def _shown(self, picture: VideoFrame) -> Image:
        image = parse_orientation(picture, self._aspect).image(picture)
        size = image.shape[1], image.shape[0]
        if size == self.size:
            return image
        if not self._resized:
            self._resized = True
            log.warning(
                "%s: its pictures are %dx%d from frame %d on, they were %dx%d: they are fitted into that",
                *(redact_address(self._path), *size, self._asked + 1, *self.size),
            )
        return Letterbox(size, self.size).image(image)

    def _say_what_is_odd(self, first: VideoFrame) -> None:
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

    def _say_gaps(self) -> None:
        if self._gaps is not None:
            length = self._at + 1
            self._gaps.say(length, self._number / self._seconds if self._seconds else self.fps)


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
