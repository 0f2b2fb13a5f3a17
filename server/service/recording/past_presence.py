"""Whether somebody had been seen lately, at any moment of the past: for who may see that person alone."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from typing import TYPE_CHECKING

from server.media.picture import Picture
from server.media.stream_format import Agreement
from server.service.recording.decision_log import said
from server.service.recording.media_files import Gop, pictures_of
from server.service.recording.recorder import Past
from server.service.streaming.presence import last_places

if TYPE_CHECKING:
    from server.service.recording.playback import Source

_AHEAD_S = 60.0
"""So much more is read than is asked for: as a rule, the next moment is asked for next."""


class PastPresence:
    """Says it by what was said about GOPs when they were decided; lately is ``unseen`` frames before."""

    def __init__(self, past: Past, numbers: tuple[int, ...], unseen: int, fps: float) -> None:
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
        async for it in said(self._past, begin, until):
            if it.is_numbered:
                last = last_places(it.choices.boxes)
                seen += [it.choices.first + last[number] for number in self._numbers if number in last]
        self._known, self._seen = range(begin, until), sorted(seen)


@dataclass(frozen=True, slots=True)
class Shown:
    """Some pictures of the past, as somebody may see them."""

    pictures: list[Picture]
    silent: bool
    """Whether nothing may be heard meanwhile."""


async def shown_of(gop: Gop, source: Source, agreement: Agreement, fps: float) -> Shown:
    """Return a GOP's pictures, or grey ones, if there are any, where the person had not been seen lately."""
    pictures, presence = pictures_of(gop, agreement), source.presence
    if presence is None or await presence.had_been_seen(gop.first, gop.end):
        return Shown(pictures, silent=False)
    return Shown(agreement.blank(pictures[0], gop.first, gop.end - gop.first, fps), silent=True)
