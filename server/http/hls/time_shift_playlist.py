"""Time-shift playlists: HLS of recorded segments, at the addresses that they had when live."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass

from aiohttp import web

from server.http.app_keys import SERVICE
from server.http.hls.long_playlist import MOST, MOST_GROWING, long_playlist, trimmed
from server.http.hls.playlist import multivariant_playlist, playlist_response
from server.http.json_responses import error_response, unavailable
from server.http.streams.time_range import parse_time_range, refuse_unrecorded
from server.service.facade.recordings import PlaybackRange, RecordedStream, SegmentList, TimeReferenceError
from server.service.facade.streams import HlsSegment, HlsSegmenter, SegmentLayout
from server.service.service import BestViewService

_LIVE = "live"
"""The end of a playlist that has none."""
_PULSE = re.compile("p[0-9]+")
_EXPLICIT_END = re.compile(f"{_PULSE.pattern}|{_LIVE}")


@dataclass(frozen=True, slots=True)
class HlsStream:
    """A stream's HLS segments: the newest ones, if it is live, and all recorded ones."""

    live: HlsSegmenter | None
    recorded: RecordedStream

    @property
    def exists(self) -> bool:
        """Whether there is or was such a stream."""
        return self.live is not None or self.recorded.available_from(0) is not None

    @property
    def is_over(self) -> bool:
        """Whether nothing will be added to it."""
        return self.live is None or self.live.has_ended


async def time_shift_playlist(request: web.Request, stream: HlsStream) -> web.Response:
    """Return the playlist from one pulse to another, or an endless one; for other moments, redirect to that.

    A playlist is fetched again and again, and must go on where it began: so its address must not say how long
    ago that was. And an endless one must not cover a whole day.
    """
    service, recorded = request.app[SERVICE], stream.recorded
    try:
        playback = parse_time_range(request, service, recorded.end, endless=_LIVE)
    except TimeReferenceError as error:
        return error_response(400, str(error))
    missing = await refuse_unrecorded(recorded, playback)
    if missing is not None:
        return missing
    rewound, plan = recorded.time_shift(over=stream.is_over), service.streams.segment_plan
    listing = rewound.segments(playback.start, playback.end)
    if listing is None:
        return unavailable("the first segment is not whole yet")
    grows = not rewound.has_ended and (playback.end is None or playback.end > rewound.end)
    if playback.end is not None:
        most = MOST_GROWING if grows else MOST
        until = (listing.numbers.start + most) * plan.segment_frames
        if (playback.end if grows else listing.end) > until:
            return error_response(400, _too_long(most, plan, until, grows=grows))
    if not (_PULSE.fullmatch(request.query["from"]) and _EXPLICIT_END.fullmatch(request.query.get("to", ""))):
        return _multivariant(service, stream, _address(playback, listing, has_end="to" in request.query))
    listing = trimmed(listing) if playback.end is None else listing
    over = rewound.has_ended or (playback.end is not None and listing.end >= playback.end)
    extra = [] if over else ["#EXT-X-START:TIME-OFFSET=0"]
    return playlist_response(long_playlist(listing, plan, service.pulse0, extra, ended=over))


async def time_shift_segment(request: web.Request, stream: HlsStream, number: int) -> HlsSegment | None:
    """Return a segment that has left the live playlist; None if it is not recorded."""
    recorded, frames = stream.recorded, request.app[SERVICE].streams.segment_plan.segment_frames
    rewound = recorded.time_shift(over=stream.is_over)
    with suppress(OSError):  # what cannot be read is a gap
        await recorded.check_ends(number * frames, (number + 1) * frames)
    return await rewound.segment(number)


def _too_long(most: int, plan: SegmentLayout, until: int, *, grows: bool) -> str:
    what, instead = ("a list that grows", f"to={_LIVE}, or ") if grows else ("a list", "")
    seconds = most * plan.segment_frames / plan.fps
    return f"to: {what} has {most} segments at most, here {seconds:.0f} s; say {instead}to=p{until}"


def _address(playback: PlaybackRange, listing: SegmentList, *, has_end: bool) -> str:
    """Return the address of the playlist of a range; ``has_end``: the request has a to=.

    Without it the playlist is endless where it begins a short while ago; otherwise it has what there is by
    now, as far as a playlist may go.
    """
    end = _LIVE if playback.end is None else f"p{playback.end}"
    if not has_end and len(listing.numbers) > MOST_GROWING // 2:
        end = f"p{min(listing.end, (listing.numbers.start + MOST) * listing.frames)}"
    return f"index.m3u8?from=p{playback.start}&to={end}"


def _multivariant(service: BestViewService, stream: HlsStream, address: str) -> web.Response:
    codec, audio_codec, config = service.streams.codec, service.streams.audio_codec, service.config
    if codec is None:
        return unavailable("no camera has delivered a picture yet")
    codecs = codec if audio_codec is None else f"{codec},{audio_codec}"
    audio_bits = 0 if audio_codec is None else 1000 * config.sound.kbps
    bits = round(stream.recorded.peak_bit_rate() + audio_bits)
    return playlist_response(multivariant_playlist(address, bits, codecs, config.site))
