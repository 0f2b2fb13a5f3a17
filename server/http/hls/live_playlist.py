"""Live playlists: the newest segments of a stream, and the parts of the one that grows (Low-Latency HLS).

A player that knows parts (draft-pantos-hls-rfc8216bis) requests the playlist that will have the next one, and
is answered when it has; others ignore the tags.
"""

from __future__ import annotations

import asyncio
from weakref import WeakKeyDictionary

from aiohttp import web

from server.http.hls.playlist import ListedPart, ListedSegment, part_name, playlist, playlist_response
from server.http.json_responses import error_response, unavailable
from server.service.facade.streams import HlsPart, HlsSegment, HlsSegmenter

_PART_HOLD_BACK = 3
"""Part durations that a player stays behind the newest (4.4.3.8: at least two, better three)."""
_PARTS_LISTED = 3
"""Target durations from the end in which parts are listed (6.2.2)."""
_MOST_AHEAD = 2
"""Segments ahead that may be requested (6.2.5.2)."""
_BLOCK_MOST = 3
"""Target durations after which a blocked request fails (6.2.5.2)."""
_CACHE: WeakKeyDictionary[HlsSegmenter, tuple[tuple[int, bool, float | None], str]] = WeakKeyDictionary()
"""The newest playlist of each stream, with the state of the stream that it was written for."""


async def live_playlist(request: web.Request, reel: HlsSegmenter, pulse0: float | None) -> web.Response:
    """Return the newest playlist; where ``_HLS_msn`` requests a later part, block until it has that."""
    requested = _blocking_target(request, reel)
    if isinstance(requested, web.Response):
        return requested
    if requested is not None and not await _wait_for(reel, *requested):
        return unavailable("the requested part has not come")
    if not reel.playlist_segments:
        return unavailable("the first segment is not whole yet")
    return playlist_response(_cached(reel, pulse0))


async def wait_for_part(reel: HlsSegmenter, number: int, index: int) -> HlsPart | None:
    """Return a part of a segment, or None; one that a playlist has announced is waited for."""
    if reel.part(number, index) is None and _is_next(reel, number, index):
        await _wait_for(reel, number, index)
    return reel.part(number, index)


def _cached(reel: HlsSegmenter, pulse0: float | None) -> str:
    """Return the newest playlist, written once however many wait for it."""
    state = (reel.until, reel.has_ended, pulse0)
    cached = _CACHE.get(reel)
    if cached is None or cached[0] != state:
        cached = _CACHE[reel] = (state, _write(reel, pulse0))
    return cached[1]


def _write(reel: HlsSegmenter, pulse0: float | None) -> str:
    plan, growing = reel.layout, reel.open_segment
    oldest = reel.until - _PARTS_LISTED * plan.target_s * plan.fps
    listed = [
        ListedSegment(it.number, it.first, it.until, _parts(it, oldest)) for it in reel.playlist_segments
    ]
    if growing is not None and growing.parts:
        parts = _parts(growing, oldest)
        listed.append(ListedSegment(growing.number, growing.first, growing.until, parts, whole=False))
    length = plan.gop / plan.fps
    extra = ["#EXT-X-SERVER-CONTROL:CAN-BLOCK-RELOAD=YES"]
    if plan.has_parts:
        extra = [
            f"#EXT-X-SERVER-CONTROL:CAN-BLOCK-RELOAD=YES,PART-HOLD-BACK={_PART_HOLD_BACK * length:.5f}",
            f"#EXT-X-PART-INF:PART-TARGET={length:.5f}",
        ]
    hint = part_name(*_next(reel)) if plan.has_parts and not reel.has_ended else None
    return playlist(listed, plan, pulse0, extra, ended=reel.has_ended, hint=hint)


def _parts(segment: HlsSegment, oldest: float) -> list[ListedPart]:
    if segment.until <= oldest:
        return []
    return [ListedPart(it.chunk.until - it.chunk.first, it.independent) for it in segment.parts]


def _next(reel: HlsSegmenter) -> tuple[int, int]:
    """Return the segment number and index of the part that comes next."""
    number, pulses = divmod(reel.until, reel.layout.segment_frames)
    return number, pulses // reel.layout.gop


def _is_next(reel: HlsSegmenter, number: int, index: int) -> bool:
    return reel.layout.has_parts and not reel.has_ended and (number, index) == _next(reel)


def _blocking_target(
    request: web.Request, reel: HlsSegmenter
) -> tuple[int, int | None] | web.Response | None:
    """Return the segment and part that the playlist is to have; None: it need not wait.

    Returns:
        A response where the query is wrong.
    """
    number, index = request.query.get("_HLS_msn"), request.query.get("_HLS_part")
    if number is None and index is None:
        return None
    if number is None:
        return error_response(400, "_HLS_part: needs _HLS_msn, the segment that it is a part of")
    for name, value in (("_HLS_msn", number), ("_HLS_part", index)):
        if value is not None and not (value.isascii() and value.isdecimal() and len(value) <= len("9" * 12)):
            return error_response(400, f"{name}={value}: must be a whole number")
    last = reel.until // reel.layout.segment_frames
    if int(number) > last + _MOST_AHEAD and not reel.has_ended:
        return error_response(400, f"_HLS_msn={number}: is too far ahead; the newest segment is {last}")
    return int(number), None if index is None else int(index)


async def _wait_for(reel: HlsSegmenter, number: int, index: int | None) -> bool:
    """Wait until a part, or a whole segment, is there or the stream ends; return False after too long."""
    try:
        async with asyncio.timeout(_BLOCK_MOST * reel.layout.target_s):
            while not reel.has_ended and not reel.has_reached(number, index):
                await reel.wait_for_update()
    except TimeoutError:
        return False
    return True
