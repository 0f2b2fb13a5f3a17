"""HLS of the past: playlists over what is kept, of segments at the addresses that they had when new."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

from aiohttp import web

from server.http.api.handlers import not_now, problem
from server.http.app_keys import SERVICE
from server.http.hls.long_playlist import MOST, MOST_GROWING, long_playlist, newest
from server.http.hls.playlist import master, playlist_answer
from server.http.streams.time_shift import new_timeline, nothing_kept, wish_of
from server.service.recording.media_files import run_in_reader_thread
from server.service.service import BestViewService
from server.service.streaming.hls_segmenter import HlsSegment, HlsSegmenter, SegmentLayout
from server.service.time_shift.availability import first_available, forget_missing_ends
from server.service.time_shift.hls_time_shift import SegmentList, TimeShift
from server.service.time_shift.playback import PlaybackSource, recorded_audio
from server.service.time_shift.playback_audio import PlaybackAudio
from server.service.time_shift.time_reference import TimeReferenceError
from server.service.time_shift.time_shift_stream import PlaybackRange

_LIVE = "live"
"""The end of a list that has none."""
_PULSE = re.compile("p[0-9]+")
_NAMED_END = re.compile(f"{_PULSE.pattern}|{_LIVE}")


@dataclass(frozen=True, slots=True)
class Stream:
    """A stream as HLS has it: what is new, and what is past. ``reel`` is None where nothing is new."""

    what: str
    reel: HlsSegmenter | None
    source: PlaybackSource

    @property
    def exists(self) -> bool:
        """Whether there is or was such a stream."""
        return self.reel is not None or first_available(self.source, 0) is not None


async def playlist_of_the_past(request: web.Request, stream: Stream) -> web.Response:
    """List the segments from one pulse to another, or on and on; of other wishes, name that playlist.

    A playlist is fetched again and again, and must go on where it began: so its address must not say how long
    ago that was. And one that goes on and on must not be of a whole day.
    """
    service = request.app[SERVICE]
    try:
        wish = wish_of(request, service, stream.source.end, endless=_LIVE)
    except TimeReferenceError as error:
        return problem(400, str(error))
    missing = await nothing_kept(stream.source, wish, stream.what)
    if missing is not None:
        return missing
    rewound, plan = _rewound(service, stream), service.splicer.layout
    listing = rewound.listing(wish.start, wish.end)
    if listing is None:
        return not_now("the first segment is not whole yet")
    grows = not rewound.over and (wish.end is None or wish.end > rewound.end)
    if wish.end is not None:
        most = MOST_GROWING if grows else MOST
        until = (listing.numbers.start + most) * plan.segment_frames
        if (wish.end if grows else listing.end) > until:
            return problem(400, _too_long(most, plan, until, grows=grows))
    if not (_PULSE.fullmatch(request.query["from"]) and _NAMED_END.fullmatch(request.query.get("to", ""))):
        return _master(service, stream, _address(wish, listing, has_end="to" in request.query))
    listing = newest(listing) if wish.end is None else listing
    over = rewound.over or (wish.end is not None and listing.end >= wish.end)
    extra = [] if over else ["#EXT-X-START:TIME-OFFSET=0"]
    return playlist_answer(long_playlist(listing, plan, service.pulse0, extra, ended=over))


async def segment_of_the_past(request: web.Request, stream: Stream, number: int) -> HlsSegment | None:
    """Give a segment that is not in the newest playlist any more; None where it is not kept."""
    rewound, frames = (
        _rewound(request.app[SERVICE], stream),
        request.app[SERVICE].splicer.layout.segment_frames,
    )
    with suppress(OSError):  # what cannot be read is a hole
        await run_in_reader_thread(forget_missing_ends, stream.source, number * frames, (number + 1) * frames)
    return await rewound.segment(number)


def _rewound(service: BestViewService, stream: Stream) -> TimeShift:
    past = service.past
    hearing = partial(_hearing, service)
    timeline = partial(new_timeline, service)
    plan, gop, decided = service.splicer.layout, service.config.encode.gop, past.recent.end
    over = _is_over(stream)
    return TimeShift(stream.source, plan, timeline, hearing, gop=gop, decided=decided, over=over)


def _hearing(service: BestViewService) -> PlaybackAudio | None:
    past, sound = service.past, service.past.sound
    return None if sound is None else PlaybackAudio(sound, lambda: recorded_audio(past))


def _is_over(stream: Stream) -> bool:
    return stream.reel is None or stream.reel.has_ended


def _too_long(most: int, plan: SegmentLayout, until: int, *, grows: bool) -> str:
    what, instead = ("a list that grows", f"to={_LIVE}, or ") if grows else ("a list", "")
    seconds = most * plan.segment_frames / plan.fps
    return f"to: {what} has {most} segments at most, here {seconds:.0f} s; say {instead}to=p{until}"


def _address(wish: PlaybackRange, listing: SegmentList, *, has_end: bool) -> str:
    """Name the playlist of a wish; ``has_end``: it says to when.

    One that does not goes on and on where it begins a short while ago, and else has what there is by now, as
    far as a playlist may go.
    """
    end = _LIVE if wish.end is None else f"p{wish.end}"
    if not has_end and len(listing.numbers) > MOST_GROWING // 2:
        end = f"p{min(listing.end, (listing.numbers.start + MOST) * listing.frames)}"
    return f"index.m3u8?from=p{wish.start}&to={end}"


def _master(service: BestViewService, stream: Stream, address: str) -> web.Response:
    parameters, site, sound = service.agreement.parameters, service.config.site, service.config.sound
    if parameters is None:
        return not_now("no camera has delivered a picture yet")
    codecs = parameters.codec if sound.format is None else f"{parameters.codec},{sound.format.codec}"
    bits = _peak(stream.source, site.fps) + (0 if sound.format is None else 1000 * sound.kbps)
    return playlist_answer(master(address, round(bits), codecs, site))


def _peak(source: PlaybackSource, fps: float) -> float:
    """Give the most bits a second that pictures took, by whole files of the recording and GOPs in memory."""
    rates = [8 * it.length / it.frames for one in source.recorded for it in one.tape.all]
    gop = source.recall(0)
    while gop is not None:
        rates.append(8 * sum(map(len, gop.fragments)) / len(gop.fragments))
        gop = source.recall(gop.end)
    return fps * max(rates, default=0.0)
