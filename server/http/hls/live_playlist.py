"""The newest of a stream as HLS: whole segments, and GOP by GOP what is newer, for who asks in advance.

A player that knows parts (Low-Latency HLS, draft-pantos-hls-rfc8216bis) asks for the playlist that will have
the next one, and is answered when it has; others pass over what they do not know.
"""

from __future__ import annotations

import asyncio
from weakref import WeakKeyDictionary

from aiohttp import web

from server.http.api.handlers import not_now, problem
from server.http.hls.playlist import Listed, ListedPart, part_name, playlist, playlist_answer
from server.service.streaming.hls_segmenter import HlsPart, HlsSegment, HlsSegmenter

_HELD_BACK = 3
"""Parts that a player stays behind the newest (4.4.3.8: at least twice, better three times their length)."""
_RECENT = 3
"""Target durations from the end in which parts are listed (6.2.2)."""
_FAR = 2
"""Segments ahead that may be asked for (6.2.5.2)."""
_WAIT = 3
"""Target durations after which what was asked for does not come (6.2.5.2)."""
_WRITTEN: WeakKeyDictionary[HlsSegmenter, tuple[tuple[int, bool, float | None], str]] = WeakKeyDictionary()
"""The newest playlist of each stream, and of what state of it that is."""


async def newest(request: web.Request, reel: HlsSegmenter, pulse0: float | None) -> web.Response:
    """Answer with the newest playlist; where ``_HLS_msn`` asks for more, with the first one that has it."""
    wanted = _wanted(request, reel)
    if isinstance(wanted, web.Response):
        return wanted
    if wanted is not None and not await _waited(reel, *wanted):
        return not_now("the part that was asked for has not come")
    if not reel.playlist_segments:
        return not_now("the first segment is not whole yet")
    return playlist_answer(_newest(reel, pulse0))


async def coming_part(reel: HlsSegmenter, number: int, index: int) -> HlsPart | None:
    """Give a part; one that a playlist has promised is waited for."""
    if reel.part(number, index) is None and _is_next(reel, number, index):
        await _waited(reel, number, index)
    return reel.part(number, index)


def _newest(reel: HlsSegmenter, pulse0: float | None) -> str:
    """Write the newest playlist, once however many wait for it."""
    state = (reel.until, reel.has_ended, pulse0)
    known = _WRITTEN.get(reel)
    if known is None or known[0] != state:
        known = _WRITTEN[reel] = (state, _written(reel, pulse0))
    return known[1]


def _written(reel: HlsSegmenter, pulse0: float | None) -> str:
    plan, growing = reel.layout, reel.open_segment
    oldest = reel.until - _RECENT * plan.target_s * plan.fps
    listed = [Listed(it.number, it.first, it.until, _parts(it, oldest)) for it in reel.playlist_segments]
    if growing is not None and growing.parts:
        parts = _parts(growing, oldest)
        listed.append(Listed(growing.number, growing.first, growing.until, parts, whole=False))
    length = plan.gop / plan.fps
    extra = ["#EXT-X-SERVER-CONTROL:CAN-BLOCK-RELOAD=YES"]
    if plan.has_parts:
        extra = [
            f"#EXT-X-SERVER-CONTROL:CAN-BLOCK-RELOAD=YES,PART-HOLD-BACK={_HELD_BACK * length:.5f}",
            f"#EXT-X-PART-INF:PART-TARGET={length:.5f}",
        ]
    hint = part_name(*_next(reel)) if plan.has_parts and not reel.has_ended else None
    return playlist(listed, plan, pulse0, extra, ended=reel.has_ended, hint=hint)


def _parts(segment: HlsSegment, oldest: float) -> list[ListedPart]:
    if segment.until <= oldest:
        return []
    return [ListedPart(it.chunk.until - it.chunk.first, it.independent) for it in segment.parts]


def _next(reel: HlsSegmenter) -> tuple[int, int]:
    """Give segment and index of the part that comes next."""
    number, pulses = divmod(reel.until, reel.layout.segment_frames)
    return number, pulses // reel.layout.gop


def _is_next(reel: HlsSegmenter, number: int, index: int) -> bool:
    return reel.layout.has_parts and not reel.has_ended and (number, index) == _next(reel)


def _wanted(request: web.Request, reel: HlsSegmenter) -> tuple[int, int | None] | web.Response | None:
    """Give what the playlist is to have, or what is wrong with the question; None: it may be as it is."""
    number, index = request.query.get("_HLS_msn"), request.query.get("_HLS_part")
    if number is None and index is None:
        return None
    if number is None:
        return problem(400, "_HLS_part: needs _HLS_msn, the segment that it is a part of")
    for name, value in (("_HLS_msn", number), ("_HLS_part", index)):
        if value is not None and not (value.isascii() and value.isdecimal() and len(value) <= len("9" * 12)):
            return problem(400, f"{name}={value}: must be a whole number")
    last = reel.until // reel.layout.segment_frames
    if int(number) > last + _FAR and not reel.has_ended:
        return problem(400, f"_HLS_msn={number}: is too far ahead; the newest segment is {last}")
    return int(number), None if index is None else int(index)


async def _waited(reel: HlsSegmenter, number: int, index: int | None) -> bool:
    """Wait until a part, or a whole segment, is there; tell whether it is, or the stream is over."""
    try:
        async with asyncio.timeout(_WAIT * reel.layout.target_s):
            while not reel.has_ended and not reel.has_reached(number, index):
                await reel.wait_for_update()
    except TimeoutError:
        return False
    return True
