"""VP8 in WebM as the format of a site's streams (RFC 6386, RFC 9559)."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from server.media.audio.audio_format import AudioFormat
from server.media.containers.webm import cluster, header, shift_cluster, ticks
from server.media.gap_filler import NO_BOOT, GapFiller, Span
from server.media.picture import Codec, EncodedPicture
from server.media.stream_format import Container, ParameterMismatchError, StreamFormat
from server.media.vp8.gray_frame import gray_frame
from server.media.vp8.repeat_frame import repeat_frame

_KEY_HEAD = struct.Struct("<3x3sHH")
"""A keyframe's frame tag, start code, width and height; the two high bits of each are its scale (9.1)."""
_START = b"\x9d\x01\x2a"
_SIDE = 0x3FFF


class Vp8StreamFormat(StreamFormat):
    """VP8 in WebM: there are no parameter sets; a keyframe carries its size and resets the decoder."""

    container: Container = "webm"

    def __init__(self, width: int, height: int) -> None:
        super().__init__()
        self._size = (width, height)

    @property
    def picture_codec(self) -> Codec:
        """The codec of the pictures."""
        return "vp8"

    @property
    def codec(self) -> str:
        """The codec string of browsers."""
        return "vp8"

    def accept(self, access_unit: bytes) -> None:
        """Check a keyframe.

        Raises:
            ParameterMismatchError: it is not VP8 of the site's size.
        """
        if keyframe_size(access_unit) != self._size:
            raise ParameterMismatchError("its frames are not VP8 of the site's size")

    def pack(self, access_unit: bytes, pulse: int, fps: float, *, key: bool) -> bytes:
        """Return a frame as a cluster, which can be spliced into any stream of the site."""
        return cluster(access_unit, pulse, fps, key=key)

    def init_segment(
        self,
        size: tuple[int, int],
        fps: float,
        audio: AudioFormat | None = None,
        *,
        pulses: int | None = None,
    ) -> bytes:
        """Return the initialization segment, without audio."""
        del audio
        return header(*size, fps, pulses)

    def rebase(self, origin: int, fragment: bytes, fps: float) -> bytes:
        """Return a cluster shifted into a stream whose time 0 is the pulse ``origin``."""
        return shift_cluster(fragment, -ticks(origin, fps))

    def gap_filler(self, newest: EncodedPicture, fps: float) -> GapFiller:
        """Return the gap filler, the same after any picture."""
        del newest
        return Vp8GapFiller(repeat_frame(*self._size), fps)

    def blank(
        self, newest: EncodedPicture | None, first: int, frames: int, fps: float
    ) -> list[EncodedPicture]:
        """Return a GOP of gray pictures."""
        del newest
        packed = cluster(gray_frame(*self._size), first, fps, key=True)
        key = EncodedPicture(first, key=True, fragment=packed, boot=NO_BOOT, codec="vp8")
        spans = [(pulse, 1) for pulse in range(first + 1, first + frames)]
        return [key, *Vp8GapFiller(repeat_frame(*self._size), fps).repeat_until_keyframe(key, spans)]


@dataclass(frozen=True, slots=True)
class Vp8GapFiller:
    """Repeats the last picture; the repetitions do not affect decoding."""

    data: bytes
    fps: float

    def can_read(self, picture: EncodedPicture) -> bool:
        """Return True: nothing is read from the picture."""
        del picture
        return True

    def repeat_until_keyframe(self, newest: EncodedPicture, spans: Sequence[Span]) -> list[EncodedPicture]:
        """Return a picture for each span."""
        del newest
        return [self._picture(span) for span in spans]

    def repeat_before(
        self, newest: EncodedPicture, picture: EncodedPicture, span: Span
    ) -> list[EncodedPicture]:
        """Return one picture, which does not affect decoding of the next one."""
        del newest, picture
        return [self._picture(span)]

    def is_lost_between(self, newest: EncodedPicture, picture: EncodedPicture, missing: int) -> bool:
        """Return whether frames were lost between two pictures, by the reference that the camera reports."""
        return missing > 0 and picture.reference_pulse != newest.pulse

    def _picture(self, span: Span) -> EncodedPicture:
        pulse, duration = span
        packed = cluster(self.data, pulse, self.fps, key=False, duration=duration)
        return EncodedPicture(pulse, key=False, fragment=packed, boot=NO_BOOT, duration=duration, codec="vp8")


def keyframe_size(frame: bytes) -> tuple[int, int] | None:
    """Return width and height of a keyframe; None for other frames."""
    if len(frame) < _KEY_HEAD.size or frame[0] & 1:
        return None
    start, width, height = _KEY_HEAD.unpack_from(frame)
    return (width & _SIDE, height & _SIDE) if start == _START else None
