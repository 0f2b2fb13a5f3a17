"""Long playlists: of thousands of segments, which who fetches them fetches again and again."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from server.http.hls.playlist import Listed, head_lines, segment_lines
from server.service.streaming.hls_segmenter import SegmentLayout
from server.service.time_shift.hls_time_shift import SegmentList

MOST = 9_000
"""Segments in a list that is fetched once, because nothing is to follow: two hours of 0.8 s each."""
MOST_GROWING = 4_500
"""Segments in one that grows, and is fetched once a second."""
_STEP = 64
"""Segments from one time of day to the next: of each segment it would be most of the text."""


def newest(listing: SegmentList) -> SegmentList:
    """Leave out the oldest segments of a list that has become too long.

    The new first one has had its time of day before: what stays in a playlist must not change (RFC 8216,
    6.2.1).
    """
    first = listing.numbers.stop - MOST_GROWING
    return listing.since(first + -first % _STEP) if first > listing.numbers.start else listing


def long_playlist(
    listing: SegmentList, plan: SegmentLayout, pulse0: float | None, extra: Iterable[str] = (), *, ended: bool
) -> str:
    """Write a playlist of segments without a hole; ``pulse0`` is when pulse 0 was due, unix seconds.

    The time of day stands at the first segment, and at those whose number can be divided by 64.
    """
    first, last = listing.numbers[0], listing.numbers[-1]
    lines = head_lines(plan, first, extra)
    dated = [first, *range(first // _STEP * _STEP + _STEP, last + 1, _STEP)]
    whole = f"#EXTINF:{plan.segment_frames / plan.fps:.5f},\n"
    for begin, after in pairwise([*dated, last + 1]):
        lines += _told(listing, begin, plan, pulse0)
        lines += [f"{whole}{number}.m4s" for number in range(begin + 1, min(after, last))]
    if last != dated[-1]:
        lines += _told(listing, last, plan, None)
    lines += ["#EXT-X-ENDLIST"] if ended else []
    return "\n".join(lines) + "\n"


def _told(listing: SegmentList, number: int, plan: SegmentLayout, pulse0: float | None) -> list[str]:
    """Give the lines of a segment that may not be whole."""
    pulses = listing.pulses_of(number)
    return segment_lines(Listed(number, pulses.start, pulses.stop), plan, pulse0)
