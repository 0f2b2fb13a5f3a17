"""Time-shift playlists: recorded HLS segments, at the URLs that they had when live."""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

from aiohttp import web

from server.http.app_keys import SERVICE
from server.http.hls.playlist import (
    ListedSegment,
    head_lines,
    multivariant_playlist,
    playlist_response,
    segment_lines,
)
from server.http.json_responses import error_response, unavailable
from server.http.streams.time_range import parse_time_range, refuse_unrecorded
from server.service.facade.recordings import PlaybackRange, RecordedStream, SegmentList, TimeReferenceError
from server.service.facade.streams import HlsSegment, HlsSegmenter, SegmentLayout
from server.service.service import BestViewService

_MAX_SEGMENTS = 9_000
"""Most segments of a complete playlist, which is fetched once: two hours of 0.8 s each."""
MAX_GROWING_SEGMENTS = 4_500
"""Most segments of a growing playlist, which is fetched about once a second."""
_DATE_INTERVAL = 64
"""Segments between wall-clock times: one for every segment would be most of the text."""
_LIVE = "live"
"""The value of to= for a playlist without an end."""
_PULSE = re.compile("p[0-9]+")
_EXPLICIT_END = re.compile(f"{_PULSE.pattern}|{_LIVE}")


@dataclass(frozen=True, slots=True)
class HlsStream:
    """A stream's HLS segments: the newest if it is live, and all recorded ones."""

    live: HlsSegmenter | None
    recorded: RecordedStream

    @property
    def exists(self) -> bool:
        """Whether the stream is live or recorded."""
        return self.live is not None or self.recorded.available_from(0) is not None

    @property
    def is_over(self) -> bool:
        """Whether the stream has ended."""
        return self.live is None or self.live.has_ended


async def time_shift_playlist(request: web.Request, stream: HlsStream) -> web.Response:
    """Return the playlist of a range of pulses, or an endless one.

    Players fetch a playlist repeatedly, and its start must not move. So a start in seconds back is answered
    with a multivariant playlist, whose URL names the pulse. An endless playlist is limited, too.
    """
    service, recorded = request.app[SERVICE], stream.recorded
    try:
        playback = parse_time_range(request, service, recorded.end, endless=_LIVE)
    except TimeReferenceError as error:
        return error_response(400, str(error))
    missing = await refuse_unrecorded(recorded, playback)
    if missing is not None:
        return missing
    time_shift, layout = recorded.time_shift(has_ended=stream.is_over), service.streams.segment_plan
    listing = time_shift.segments(playback.start, playback.end)
    if listing is None:
        return unavailable("the first segment is not complete yet")
    grows = not time_shift.has_ended and (playback.end is None or playback.end > time_shift.end)
    if playback.end is not None:
        most = MAX_GROWING_SEGMENTS if grows else _MAX_SEGMENTS
        until = (listing.numbers.start + most) * layout.segment_frames
        if (playback.end if grows else listing.end) > until:
            return error_response(400, _too_long(most, layout, until, grows=grows))
    if not (_PULSE.fullmatch(request.query["from"]) and _EXPLICIT_END.fullmatch(request.query.get("to", ""))):
        return _multivariant(service, stream, _playlist_url(playback, listing, has_end="to" in request.query))
    listing = trim_growing_playlist(listing) if playback.end is None else listing
    over = time_shift.has_ended or (playback.end is not None and listing.end >= playback.end)
    extra = [] if over else ["#EXT-X-START:TIME-OFFSET=0"]
    return playlist_response(write_time_shift_playlist(listing, layout, service.pulse0, extra, ended=over))


async def time_shift_segment(request: web.Request, stream: HlsStream, number: int) -> HlsSegment | None:
    """Return a recorded segment that the live playlist no longer has; None: it is not recorded."""
    recorded, frames = stream.recorded, request.app[SERVICE].streams.segment_plan.segment_frames
    time_shift = recorded.time_shift(has_ended=stream.is_over)
    with suppress(OSError):  # an unreadable segment counts as not recorded
        await recorded.forget_missing_ends(number * frames, (number + 1) * frames)
    return await time_shift.build_segment(number)


def trim_growing_playlist(listing: SegmentList) -> SegmentList:
    """Drop the oldest segments of a listing that is too long for a growing playlist.

    The new first segment is one that had a wall-clock time before: listed segments must not change (RFC 8216,
    6.2.1).
    """
    first = listing.numbers.stop - MAX_GROWING_SEGMENTS
    return listing.since(first + -first % _DATE_INTERVAL) if first > listing.numbers.start else listing


def write_time_shift_playlist(
    listing: SegmentList,
    layout: SegmentLayout,
    pulse0: float | None,
    extra: Iterable[str] = (),
    *,
    ended: bool,
) -> str:
    """Write a playlist of consecutive segments; ``pulse0`` is the unix time at which pulse 0 was due.

    It may have thousands of segments and is fetched repeatedly, so it is written fast. The first segment and
    those whose number is divisible by 64 have a wall-clock time.
    """
    first, last = listing.numbers[0], listing.numbers[-1]
    lines = head_lines(layout, first, extra)
    dated = [
        first,
        *range(first // _DATE_INTERVAL * _DATE_INTERVAL + _DATE_INTERVAL, last + 1, _DATE_INTERVAL),
    ]
    duration = f"#EXTINF:{layout.segment_frames / layout.fps:.5f},\n"
    for begin, after in pairwise([*dated, last + 1]):
        lines += _segment_lines(listing, begin, layout, pulse0)
        lines += [f"{duration}{number}.m4s" for number in range(begin + 1, min(after, last))]
    if last != dated[-1]:
        lines += _segment_lines(listing, last, layout, None)
    lines += ["#EXT-X-ENDLIST"] if ended else []
    return "\n".join(lines) + "\n"


def _segment_lines(
    listing: SegmentList, number: int, layout: SegmentLayout, pulse0: float | None
) -> list[str]:
    """Return the lines of a segment, which may be shorter than others."""
    pulses = listing.pulses_of(number)
    return segment_lines(ListedSegment(number, pulses.start, pulses.stop), layout, pulse0)


def _too_long(most: int, layout: SegmentLayout, until: int, *, grows: bool) -> str:
    kind, alternative = ("a growing playlist", f"to={_LIVE} or ") if grows else ("a playlist", "")
    seconds = most * layout.segment_frames / layout.fps
    return f"to: {kind} has {most} segments at most, here {seconds:.0f} s; use {alternative}to=p{until}"


def _playlist_url(playback: PlaybackRange, listing: SegmentList, *, has_end: bool) -> str:
    """Return the URL of the playlist of a range; ``has_end``: the request has a to=.

    Without to=, a playlist with a recent start is endless; one with an earlier start ends now, or at the most
    segments that a playlist may have.
    """
    end = _LIVE if playback.end is None else f"p{playback.end}"
    if not has_end and len(listing.numbers) > MAX_GROWING_SEGMENTS // 2:
        end = f"p{min(listing.end, (listing.numbers.start + _MAX_SEGMENTS) * listing.frames)}"
    return f"index.m3u8?from=p{playback.start}&to={end}"


def _multivariant(service: BestViewService, stream: HlsStream, url: str) -> web.Response:
    codec, audio_codec, config = service.streams.codec, service.streams.audio_codec, service.config
    if codec is None:
        return unavailable("no camera has delivered a picture yet")
    codecs = codec if audio_codec is None else f"{codec},{audio_codec}"
    audio_bits = 0 if audio_codec is None else 1000 * config.sound.kbps
    bits = round(stream.recorded.peak_bit_rate() + audio_bits)
    return playlist_response(multivariant_playlist(url, bits, codecs, config.site))
