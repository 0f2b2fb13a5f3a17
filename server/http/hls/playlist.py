"""HLS playlists as text (RFC 8216; parts: draft-pantos-hls-rfc8216bis)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from aiohttp import web

from server.config.sections import SiteSettings
from server.service.facade.streams import SegmentLayout

TYPE = "application/vnd.apple.mpegurl"
_VERSION = 7
"""Of the protocol: the first whose segments may be fragmented MP4."""


@dataclass(frozen=True, slots=True)
class ListedSegment:
    """A segment in a playlist: pulses ``first … until - 1``."""

    number: int
    first: int
    until: int
    parts: Sequence[ListedPart] = ()
    whole: bool = True
    """Otherwise only its parts are listed."""


@dataclass(frozen=True, slots=True)
class ListedPart:
    """A part of a segment in a playlist."""

    pulses: int
    independent: bool


def part_name(segment: int, index: int) -> str:
    """Return the file name of a part of a segment."""
    return f"{segment}.{index}.m4s"


def playlist(
    segments: Iterable[ListedSegment],
    plan: SegmentLayout,
    pulse0: float | None,
    extra: Iterable[str] = (),
    *,
    ended: bool,
    hint: str | None = None,
) -> str:
    """Write the playlist of a stream; ``pulse0`` is when pulse 0 was due, unix seconds.

    Segments are numbered by their pulses, so a restarted service continues the numbers. ``extra`` are further
    lines about the whole playlist, ``hint`` names the part that comes next.
    """
    listed = list(segments)
    lines = head_lines(plan, listed[0].number if listed else 0, extra)
    for segment in listed:
        lines += segment_lines(segment, plan, pulse0)
    lines += [] if hint is None else [f'#EXT-X-PRELOAD-HINT:TYPE=PART,URI="{hint}"']
    lines += ["#EXT-X-ENDLIST"] if ended else []
    return "\n".join(lines) + "\n"


def head_lines(plan: SegmentLayout, first: int, extra: Iterable[str] = ()) -> list[str]:
    """Return the lines before the first segment, whose number is ``first``."""
    return [
        "#EXTM3U",
        f"#EXT-X-VERSION:{_VERSION}",
        f"#EXT-X-TARGETDURATION:{plan.target_s}",
        f"#EXT-X-MEDIA-SEQUENCE:{first}",
        *extra,
        "#EXT-X-INDEPENDENT-SEGMENTS",
        '#EXT-X-MAP:URI="init.mp4"',
    ]


def multivariant_playlist(address: str, bandwidth: int, codecs: str, site: SiteSettings) -> str:
    """Write a multivariant playlist of one playlist; ``bandwidth`` is its peak in bits a second."""
    attributes = (
        f'BANDWIDTH={max(1, bandwidth)},CODECS="{codecs}",RESOLUTION={site.width}x{site.height},'
        f"FRAME-RATE={site.fps:.3f}"
    )
    lines = ["#EXTM3U", f"#EXT-X-VERSION:{_VERSION}", "#EXT-X-INDEPENDENT-SEGMENTS"]
    return "\n".join([*lines, f"#EXT-X-STREAM-INF:{attributes}", address]) + "\n"


def segment_lines(segment: ListedSegment, plan: SegmentLayout, pulse0: float | None) -> list[str]:
    """Return the lines of a segment, with its time of day where ``pulse0`` is known."""
    lines = [_part_line(segment.number, index, it, plan.fps) for index, it in enumerate(segment.parts)]
    if segment.whole:
        seconds = (segment.until - segment.first) / plan.fps
        lines += [f"#EXTINF:{seconds:.5f},", f"{segment.number}.m4s"]
    if pulse0 is None:
        return lines
    begin = datetime.fromtimestamp(pulse0 + segment.first / plan.fps, UTC)
    time = begin.isoformat(timespec="milliseconds").replace("+00:00", "Z")
    return [f"#EXT-X-PROGRAM-DATE-TIME:{time}", *lines]


def _part_line(segment: int, index: int, part: ListedPart, fps: float) -> str:
    independent = ",INDEPENDENT=YES" * part.independent
    return f'#EXT-X-PART:DURATION={part.pulses / fps:.5f},URI="{part_name(segment, index)}"{independent}'


def playlist_response(text: str) -> web.Response:
    """Return a playlist as an answer that any origin may read and that is not cached."""
    headers = {"Access-Control-Allow-Origin": "*", "Cache-Control": "no-cache"}
    return web.Response(text=text, content_type=TYPE, charset="utf-8", headers=headers)
