"""A stream's timeline without gaps: a missing picture is replaced by a repetition of the previous one.

A player that receives nothing for a moment stalls, some permanently. So a picture that encodes a repetition
replaces a missing one (:mod:`server.media.gap_filler`): to a decoder it is an ordinary stream.
"""

from __future__ import annotations

from server.media.gap_filler import GapFiller
from server.media.picture import EncodedPicture
from server.media.stream_format import StreamFormat

_PER_PULSE_S = 2
"""Gaps up to so long get a picture for every pulse, longer ones a single picture of that duration."""
LONGEST_GAP_S = 3600
"""A longer gap is not filled: no viewer waits that long, and MP4 durations have 32 bits."""
_RESTART_S = 10
"""A keyframe this far back means that the pulses have restarted; it is not late."""


class GaplessTimeline:
    """The pictures that a stream has shown, and those that it must show so that the next one follows.

    ``gop`` is the number of pulses from keyframe to keyframe.
    """

    def __init__(self, stream_format: StreamFormat, fps: float, gop: int) -> None:
        self.stream_format, self._fps, self._gop = stream_format, fps, gop
        self._newest: EncodedPicture | None = None
        """The reference of the next picture."""
        self._until = 0
        self._is_broken = False
        """Whether a reference picture of the present GOP is missing; until the next keyframe."""

    @property
    def newest(self) -> EncodedPicture | None:
        """The picture that was shown last; None before the first."""
        return self._newest

    @property
    def until(self) -> int | None:
        """The first pulse that is not shown yet; None before the first picture."""
        return None if self._newest is None else self._until

    def push(self, picture: EncodedPicture) -> list[EncodedPicture]:
        """Return what to show when a picture arrives: the filler of a gap before it, then the picture.

        Late pictures, and those before the first keyframe, are dropped. A picture that cannot be decoded is
        replaced by a repetition.
        """
        if self._newest is None or self._is_restart(picture):
            return self._show(picture) if picture.key else []
        if picture.pulse < self._until:
            return []
        if not picture.key and self._reference_is_lost(picture):
            return self.fill(picture.until)
        return self._fill_before(picture) + self._show(picture)

    def record_shown(self, last: EncodedPicture) -> None:
        """Record that a complete GOP with this last picture was shown: there is no gap to fill."""
        self._show(last)

    def fill(self, until: int) -> list[EncodedPicture]:
        """Return repetitions of the last picture up to a pulse; none before the first picture."""
        gap_filler, missing = self._gap_filler(), until - self._until
        if gap_filler is None or self._newest is None or not 0 < missing <= LONGEST_GAP_S * self._fps:
            return []
        each = 1 if missing <= _PER_PULSE_S * self._fps else missing
        filler = gap_filler.repeat_until_keyframe(
            self._newest, [(pulse, each) for pulse in range(self._until, until, each)]
        )
        self._newest, self._until, self._is_broken = filler[-1], until, True
        return filler

    def _show(self, picture: EncodedPicture) -> list[EncodedPicture]:
        self._newest, self._until, self._is_broken = picture, picture.until, False
        return [picture]

    def _fill_before(self, picture: EncodedPicture) -> list[EncodedPicture]:
        """Return the filler of the gap before a picture that can be decoded after the last one."""
        if picture.pulse == self._until:
            return []
        if picture.key:
            return self.fill(picture.pulse)
        gap_filler, newest = self._gap_filler(), self._newest
        if gap_filler is None or newest is None:
            return []
        return gap_filler.repeat_before(newest, picture, (self._until, picture.pulse - self._until))

    def _reference_is_lost(self, picture: EncodedPicture) -> bool:
        """Return whether a reference of a picture is missing."""
        gap_filler, newest = self._gap_filler(), self._newest
        if gap_filler is None or newest is None:
            return False
        if (
            self._is_broken
            or picture.boot != newest.boot
            or picture.pulse // self._gop != newest.pulse // self._gop
        ):
            return True
        return gap_filler.is_lost_between(newest, picture, picture.pulse - self._until)

    def _is_restart(self, picture: EncodedPicture) -> bool:
        return picture.key and picture.pulse < self._until - _RESTART_S * self._fps

    def _gap_filler(self) -> GapFiller | None:
        return None if self._newest is None else self.stream_format.gap_filler(self._newest, self._fps)
