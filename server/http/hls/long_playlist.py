"""Long playlists: of thousands of segments, written fast since players fetch them again and again."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from server.http.hls.playlist import ListedSegment, head_lines, segment_lines
from server.service.facade.recordings import SegmentList
from server.service.facade.streams import SegmentLayout

MOST = 9_000
"""Segments in a playlist that is fetched once since nothing follows: two hours of 0.8 s each."""
MOST_GROWING = 4_500
"""Segments in a playlist that grows and is fetched once a second."""
_DATED_EVERY = 64
"""Segments from one time of day to the next: on each segment it would be most of the text."""


def trimmed(listing: SegmentList) -> SegmentList:
    """Return a listing without the oldest segments where it has become too long.

    The new first segment has had its time of day before: what stays in a playlist must not change (RFC 8216,
    6.2.1).
    """
    first = listing.numbers.stop - MOST_GROWING
    return listing.since(first + -first % _DATED_EVERY) if first > listing.numbers.start else listing


def long_playlist(
    listing: SegmentList, plan: SegmentLayout, pulse0: float | None, extra: Iterable[str] = (), *, ended: bool
) -> str:
    """Write a playlist of segments without a gap; ``pulse0`` is when pulse 0 was due, unix seconds.

    The time of day stands at the first segment, and at those whose number can be divided by 64.
    """
    first, last = listing.numbers[0], listing.numbers[-1]
    lines = head_lines(plan, first, extra)
    dated = [first, *range(first // _DATED_EVERY * _DATED_EVERY + _DATED_EVERY, last + 1, _DATED_EVERY)]
    whole = f"#EXTINF:{plan.segment_frames / plan.fps:.5f},\n"
    for begin, after in pairwise([*dated, last + 1]):
        lines += _lines(listing, begin, plan, pulse0)
        lines += [f"{whole}{number}.m4s" for number in range(begin + 1, min(after, last))]
    if last != dated[-1]:
        lines += _lines(listing, last, plan, None)
    lines += ["#EXT-X-ENDLIST"] if ended else []
    return "\n".join(lines) + "\n"


def _lines(listing: SegmentList, number: int, plan: SegmentLayout, pulse0: float | None) -> list[str]:
    """Return the lines of a segment, which may be cut short."""
    pulses = listing.pulses_of(number)
    return segment_lines(ListedSegment(number, pulses.start, pulses.stop), plan, pulse0)
