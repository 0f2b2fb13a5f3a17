"""Live playlists: the newest segments of a stream, and the parts of its open segment (Low-Latency HLS).

Players that support parts (draft-pantos-hls-rfc8216bis) request the playlist with the next part, and the
answer blocks until that exists; other players ignore the tags.
"""

from __future__ import annotations

import asyncio
from weakref import WeakKeyDictionary

from aiohttp import web

from server.http.hls.playlist import ListedPart, ListedSegment, part_name, playlist, playlist_response
from server.http.json_responses import error_response, unavailable
from server.service.facade.streams import HlsPart, HlsSegment, HlsSegmenter

_PART_HOLD_BACK = 3
"""PART-HOLD-BACK in part durations (4.4.3.8: at least two, better three)."""
_PARTS_LISTED = 3
"""Target durations before the end for which parts are listed (6.2.2)."""
_MAX_AHEAD = 2
"""How many segments ahead a request may be (6.2.5.2)."""
_MAX_BLOCK = 3
"""Target durations after which a blocked request fails (6.2.5.2)."""
_CACHE: WeakKeyDictionary[HlsSegmenter, tuple[tuple[int, bool, float | None], str]] = WeakKeyDictionary()
"""The newest playlist of each stream, with the stream state that it was written for."""


async def live_playlist(request: web.Request, segmenter: HlsSegmenter, pulse0: float | None) -> web.Response:
    """Return the newest playlist; block until it has the part that ``_HLS_msn`` and ``_HLS_part`` request."""
    requested = _blocking_target(request, segmenter)
    if isinstance(requested, web.Response):
        return requested
    if requested is not None and not await _wait_for(segmenter, *requested):
        return unavailable("the requested part did not arrive in time")
    if not segmenter.playlist_segments:
        return unavailable("the first segment is not complete yet")
    return playlist_response(_cached(segmenter, pulse0))


async def wait_for_part(segmenter: HlsSegmenter, number: int, index: int) -> HlsPart | None:
    """Return a part of a segment, waiting for it if it is the next one; None: there is no such part."""
    if segmenter.part(number, index) is None and _is_next(segmenter, number, index):
        await _wait_for(segmenter, number, index)
    return segmenter.part(number, index)


def _cached(segmenter: HlsSegmenter, pulse0: float | None) -> str:
    """Return the newest playlist, written once for all players."""
    state = (segmenter.until, segmenter.has_ended, pulse0)
    cached = _CACHE.get(segmenter)
    if cached is None or cached[0] != state:
        cached = _CACHE[segmenter] = (state, _write(segmenter, pulse0))
    return cached[1]


def _write(segmenter: HlsSegmenter, pulse0: float | None) -> str:
    layout, open_segment = segmenter.layout, segmenter.open_segment
    oldest = segmenter.until - _PARTS_LISTED * layout.target_s * layout.fps
    listed = [
        ListedSegment(segment.number, segment.first, segment.until, _parts(segment, oldest))
        for segment in segmenter.playlist_segments
    ]
    if open_segment is not None and open_segment.parts:
        parts = _parts(open_segment, oldest)
        number, first, until = open_segment.number, open_segment.first, open_segment.until
        listed.append(ListedSegment(number, first, until, parts, complete=False))
    part_s = layout.gop / layout.fps
    extra = ["#EXT-X-SERVER-CONTROL:CAN-BLOCK-RELOAD=YES"]
    if layout.has_parts:
        extra = [
            f"#EXT-X-SERVER-CONTROL:CAN-BLOCK-RELOAD=YES,PART-HOLD-BACK={_PART_HOLD_BACK * part_s:.5f}",
            f"#EXT-X-PART-INF:PART-TARGET={part_s:.5f}",
        ]
    hint = part_name(*_next(segmenter)) if layout.has_parts and not segmenter.has_ended else None
    return playlist(listed, layout, pulse0, extra, ended=segmenter.has_ended, hint=hint)


def _parts(segment: HlsSegment, oldest: float) -> list[ListedPart]:
    if segment.until <= oldest:
        return []
    return [ListedPart(part.chunk.until - part.chunk.first, part.independent) for part in segment.parts]


def _next(segmenter: HlsSegmenter) -> tuple[int, int]:
    """Return the segment number and the index of the next part."""
    number, pulses = divmod(segmenter.until, segmenter.layout.segment_frames)
    return number, pulses // segmenter.layout.gop


def _is_next(segmenter: HlsSegmenter, number: int, index: int) -> bool:
    return segmenter.layout.has_parts and not segmenter.has_ended and (number, index) == _next(segmenter)


def _blocking_target(
    request: web.Request, segmenter: HlsSegmenter
) -> tuple[int, int | None] | web.Response | None:
    """Return the segment and part to wait for.

    Returns:
        None: the request does not block; a response: its query is invalid.
    """
    number, index = request.query.get("_HLS_msn"), request.query.get("_HLS_part")
    if number is None and index is None:
        return None
    if number is None:
        return error_response(400, "_HLS_part: needs _HLS_msn, the number of its segment")
    for name, value in (("_HLS_msn", number), ("_HLS_part", index)):
        if value is not None and not (value.isascii() and value.isdecimal() and len(value) <= len("9" * 12)):
            return error_response(400, f"{name}={value}: must be a whole number")
    last = segmenter.until // segmenter.layout.segment_frames
    if int(number) > last + _MAX_AHEAD and not segmenter.has_ended:
        return error_response(400, f"_HLS_msn={number}: is too far ahead; the newest segment is {last}")
    return int(number), None if index is None else int(index)


async def _wait_for(segmenter: HlsSegmenter, number: int, index: int | None) -> bool:
    """Wait until a part or a whole segment exists or the stream ends; return False after a timeout."""
    try:
        async with asyncio.timeout(_MAX_BLOCK * segmenter.layout.target_s):
            while not segmenter.has_ended and not segmenter.has_reached(number, index):
                await segmenter.wait_for_update()
    except TimeoutError:
        return False
    return True
