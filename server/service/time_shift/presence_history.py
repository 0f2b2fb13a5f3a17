"""Whether somebody had been seen lately, at any moment of the past: for who may see that person alone."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from typing import TYPE_CHECKING

from server.media.picture import EncodedPicture
from server.media.stream_format import StreamFormat
from server.service.recording.media_files import RecordedGop, pictures_of_gop
from server.service.recording.recorder import Recorder
from server.service.streaming.presence import last_seen_offsets
from server.service.time_shift.decision_log import read_decisions

if TYPE_CHECKING:
    from server.service.time_shift.playback import PlaybackSource

_AHEAD_S = 60.0
"""So much more is read than is asked for: as a rule, the next moment is asked for next."""


class PresenceHistory:
    """Says it by what was said about GOPs when they were decided; lately is ``unseen`` frames before."""

    def __init__(self, past: Recorder, numbers: tuple[int, ...], unseen: int, fps: float) -> None:
        self._past, self._numbers, self._unseen = past, numbers, unseen
        self._ahead = round(_AHEAD_S * fps)
        self._known = range(0)
        self._seen: list[int] = []
        """Of each known GOP, the last frame in which some camera saw the person, in order."""

    async def had_been_seen(self, first: int, end: int) -> bool:
        """Tell whether some camera saw the person in the pulses ``first … end - 1``, or lately before."""
        begin = max(0, first - self._unseen)
        if begin < self._known.start or end > self._known.stop:
            await self._read(begin, end)
        place = bisect_left(self._seen, begin)
        return place < len(self._seen) and self._seen[place] < end

    async def _read(self, begin: int, end: int) -> None:
        decided = self._past.recent.end
        until = max(end, min(end + self._ahead, decided))
        seen: list[int] = []
        async for it in read_decisions(self._past, begin, until):
            if it.is_numbered:
                last = last_seen_offsets(it.choices.boxes)
                seen += [it.choices.first + last[number] for number in self._numbers if number in last]
        self._known, self._seen = range(begin, until), sorted(seen)


@dataclass(frozen=True, slots=True)
class VisiblePictures:
    """Some pictures of the past, as somebody may see them."""

    pictures: list[EncodedPicture]
    silent: bool
    """Whether nothing may be heard meanwhile."""


async def visible_pictures(
    gop: RecordedGop, source: PlaybackSource, agreement: StreamFormat, fps: float
) -> VisiblePictures:
    """Return a GOP's pictures, or grey ones, if there are any, where the person had not been seen lately."""
    pictures, presence = pictures_of_gop(gop, agreement), source.presence
    if presence is None or await presence.had_been_seen(gop.first, gop.end):
        return VisiblePictures(pictures, silent=False)
    return VisiblePictures(agreement.blank(pictures[0], gop.first, gop.end - gop.first, fps), silent=True)
