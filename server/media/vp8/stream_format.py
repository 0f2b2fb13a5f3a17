"""VP8 in WebM: what its streams are made of (RFC 6386, RFC 9559)."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from server.media.audio.audio_format import AudioFormat
from server.media.containers.webm import cluster, header, shift_cluster, ticks
from server.media.gap_filler import NO_CAMERAS, GapFiller, Span
from server.media.picture import EncodedPicture
from server.media.stream_format import Container, ParameterMismatchError, StreamFormat
from server.media.vp8.grey_frame import grey_frame
from server.media.vp8.repeat_frame import repeat_frame

_KEY_HEAD = struct.Struct("<3x3sHH")
"""Of a key frame: frame tag, start code, width and height below their scales (9.1)."""
_START = b"\x9d\x01\x2a"
_SIDE = 0x3FFF


class Vp8StreamFormat(StreamFormat):
    """VP8 has no parameter sets: a key frame says its size, and leaves nothing of what was before."""

    container: Container = "webm"

    def __init__(self, width: int, height: int) -> None:
        super().__init__()
        self._size = (width, height)

    @property
    def codec(self) -> str:
        """The codec string that browsers know."""
        return "vp8"

    def accept(self, key: bytes) -> None:
        """Look at a key frame.

        Raises:
            ParameterMismatchError: it is not of VP8, or not of the site's size.
        """
        if keyframe_size(key) != self._size:
            raise ParameterMismatchError("its pictures are not VP8 of the site's size")

    def pack(self, access_unit: bytes, pulse: int, fps: float, *, key: bool) -> bytes:
        """Return a frame as a cluster, which fits into any stream of the site."""
        return cluster(access_unit, pulse, fps, key=key)

    def head(
        self,
        size: tuple[int, int],
        fps: float,
        sound: AudioFormat | None = None,
        *,
        pulses: int | None = None,
    ) -> bytes:
        """Return what a player needs before the first cluster; there is no sound in it."""
        del sound
        return header(*size, fps, pulses)

    def begun_at(self, origin: int, fragment: bytes, fps: float) -> bytes:
        """Return a cluster as it is in a stream that has this pulse at time 0."""
        return shift_cluster(fragment, -ticks(origin, fps))

    def bridge(self, newest: EncodedPicture, fps: float) -> GapFiller:
        """Return what bridges holes, whatever is before them."""
        del newest
        return Vp8GapFiller(repeat_frame(*self._size), fps)

    def blank(
        self, newest: EncodedPicture | None, first: int, frames: int, fps: float
    ) -> list[EncodedPicture]:
        """Return a GOP of grey pictures."""
        del newest
        made = cluster(grey_frame(*self._size), first, fps, key=True)
        key = EncodedPicture(first, key=True, fragment=made, boot=NO_CAMERAS)
        spans = [(pulse, 1) for pulse in range(first + 1, first + frames)]
        return [key, *Vp8GapFiller(repeat_frame(*self._size), fps).after(key, spans)]


@dataclass(frozen=True, slots=True)
class Vp8GapFiller:
    """Pictures that show the last one again; nothing can tell that they were there."""

    data: bytes
    fps: float

    def can_follow(self, picture: EncodedPicture) -> bool:
        """Return that it can: nothing of it is read."""
        del picture
        return True

    def after(self, newest: EncodedPicture, spans: Sequence[Span]) -> list[EncodedPicture]:
        """Return a picture for each span."""
        del newest
        return [self._made(span) for span in spans]

    def before(self, picture: EncodedPicture, span: Span) -> list[EncodedPicture]:
        """Return the same: whatever comes next is decoded as if it were not there."""
        del picture
        return [self._made(span)]

    def is_lost_between(self, newest: EncodedPicture, picture: EncodedPicture, missing: int) -> bool:
        """Return whether frames were lost between two, by the camera's report: VP8 frames have no numbers."""
        return missing > 0 and picture.after != newest.pulse

    def _made(self, span: Span) -> EncodedPicture:
        pulse, lasts = span
        made = cluster(self.data, pulse, self.fps, key=False, lasts=lasts)
        return EncodedPicture(pulse, key=False, fragment=made, boot=NO_CAMERAS, lasts=lasts)


def keyframe_size(frame: bytes) -> tuple[int, int] | None:
    """Return width and height of a key frame; None where it is none."""
    if len(frame) < _KEY_HEAD.size or frame[0] & 1:
        return None
    start, width, height = _KEY_HEAD.unpack_from(frame)
    return (width & _SIDE, height & _SIDE) if start == _START else None
