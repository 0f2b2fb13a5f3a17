"""Whether a person had recently been seen at a past time: for viewers with access to that person alone."""

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
"""How far ahead decisions are read: playback asks for the following time next."""


class PresenceHistory:
    """Looks up recorded decisions; "recently" is within ``unseen`` frames before."""

    def __init__(self, recorder: Recorder, numbers: tuple[int, ...], unseen: int, fps: float) -> None:
        self._recorder, self._numbers, self._unseen = recorder, numbers, unseen
        self._ahead = round(_AHEAD_S * fps)
        self._known = range(0)
        self._seen: list[int] = []
        """By known GOP, the last frame in which a camera saw the person, in order."""

    async def had_been_seen(self, first: int, end: int) -> bool:
        """Return whether a camera saw the person in the pulses ``first … end - 1``, or recently before."""
        begin = max(0, first - self._unseen)
        if begin < self._known.start or end > self._known.stop:
            await self._read(begin, end)
        place = bisect_left(self._seen, begin)
        return place < len(self._seen) and self._seen[place] < end

    async def _read(self, begin: int, end: int) -> None:
        decided = self._recorder.recent.end
        until = max(end, min(end + self._ahead, decided))
        seen: list[int] = []
        async for decision in read_decisions(self._recorder, begin, until):
            if decision.has_same_persons:
                last = last_seen_offsets(decision.choices.boxes)
                seen += [decision.choices.first + last[number] for number in self._numbers if number in last]
        self._known, self._seen = range(begin, until), sorted(seen)


@dataclass(frozen=True, slots=True)
class VisiblePictures:
    """Recorded pictures as the viewer may see them."""

    pictures: list[EncodedPicture]
    is_muted: bool
    """Whether the audio must be muted."""


async def visible_pictures(
    gop: RecordedGop, source: PlaybackSource, stream_format: StreamFormat, fps: float
) -> VisiblePictures:
    """Return a GOP's pictures; gray ones, if there are any, where the person had not been seen recently."""
    pictures, presence = pictures_of_gop(gop, stream_format), source.presence
    if presence is None or await presence.had_been_seen(gop.first, gop.end):
        return VisiblePictures(pictures, is_muted=False)
    return VisiblePictures(
        stream_format.blank(pictures[0], gop.first, gop.end - gop.first, fps), is_muted=True
    )
