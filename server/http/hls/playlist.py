"""HLS playlists: their text (RFC 8216; parts: draft-pantos-hls-rfc8216bis), and tokens in their URIs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from http import HTTPStatus
from urllib.parse import quote

from aiohttp import web

from server.config.sections import SiteSettings
from server.service.facade.streams import SegmentLayout

_CONTENT_TYPE = "application/vnd.apple.mpegurl"
_VERSION = 7
"""Protocol version: the first that allows fragmented MP4 segments."""
_URI = re.compile(r'(?<=URI=")[^"]*')


@dataclass(frozen=True, slots=True)
class ListedSegment:
    """A segment in a playlist, of pulses ``first`` to ``until - 1``."""

    number: int
    first: int
    until: int
    parts: Sequence[ListedPart] = ()
    complete: bool = True
    """Whether the segment is listed itself; otherwise only its parts are."""


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
    layout: SegmentLayout,
    pulse0: float | None,
    extra: Iterable[str] = (),
    *,
    ended: bool,
    hint: str | None = None,
) -> str:
    """Write the playlist of a stream; ``pulse0`` is the unix time at which pulse 0 was due.

    Segment numbers follow from pulses, so a restarted service continues them. ``extra`` are further lines in
    the head, ``hint`` is the name of the next part.
    """
    listed = list(segments)
    lines = head_lines(layout, listed[0].number if listed else 0, extra)
    for segment in listed:
        lines += segment_lines(segment, layout, pulse0)
    lines += [] if hint is None else [f'#EXT-X-PRELOAD-HINT:TYPE=PART,URI="{hint}"']
    lines += ["#EXT-X-ENDLIST"] if ended else []
    return "\n".join(lines) + "\n"


def head_lines(layout: SegmentLayout, first: int, extra: Iterable[str] = ()) -> list[str]:
    """Return the lines before the first segment, whose number is ``first``."""
    return [
        "#EXTM3U",
        f"#EXT-X-VERSION:{_VERSION}",
        f"#EXT-X-TARGETDURATION:{layout.target_s}",
        f"#EXT-X-MEDIA-SEQUENCE:{first}",
        *extra,
        "#EXT-X-INDEPENDENT-SEGMENTS",
        '#EXT-X-MAP:URI="init.mp4"',
    ]


def multivariant_playlist(address: str, bandwidth: int, codecs: str, site: SiteSettings) -> str:
    """Write a multivariant playlist with one variant; ``bandwidth`` is its peak bit rate, bits per second."""
    attributes = (
        f'BANDWIDTH={max(1, bandwidth)},CODECS="{codecs}",RESOLUTION={site.width}x{site.height},'
        f"FRAME-RATE={site.fps:.3f}"
    )
    lines = ["#EXTM3U", f"#EXT-X-VERSION:{_VERSION}", "#EXT-X-INDEPENDENT-SEGMENTS"]
    return "\n".join([*lines, f"#EXT-X-STREAM-INF:{attributes}", address]) + "\n"


def segment_lines(segment: ListedSegment, layout: SegmentLayout, pulse0: float | None) -> list[str]:
    """Return the lines of a segment, with its wall-clock time if ``pulse0`` is known."""
    lines = [_part_line(segment.number, index, part, layout.fps) for index, part in enumerate(segment.parts)]
    if segment.complete:
        seconds = (segment.until - segment.first) / layout.fps
        lines += [f"#EXTINF:{seconds:.5f},", f"{segment.number}.m4s"]
    if pulse0 is None:
        return lines
    begin = datetime.fromtimestamp(pulse0 + segment.first / layout.fps, UTC)
    time = begin.isoformat(timespec="milliseconds").replace("+00:00", "Z")
    return [f"#EXT-X-PROGRAM-DATE-TIME:{time}", *lines]


def _part_line(segment: int, index: int, part: ListedPart, fps: float) -> str:
    independent = ",INDEPENDENT=YES" * part.independent
    return f'#EXT-X-PART:DURATION={part.pulses / fps:.5f},URI="{part_name(segment, index)}"{independent}'


def playlist_response(text: str) -> web.Response:
    """Return a playlist as a response that any origin may read and that is not cached."""
    headers = {"Access-Control-Allow-Origin": "*", "Cache-Control": "no-cache"}
    return web.Response(text=text, content_type=_CONTENT_TYPE, charset="utf-8", headers=headers)


def with_query(request: web.Request, response: web.Response) -> web.Response:
    """Append the request's token and delay, if any, to every URI of a playlist: players do not add them."""
    query = "&".join(
        f"{name}={quote(request.query[name], safe='')}"
        for name in ("token", "delay")
        if name in request.query
    )
    if query and response.status == HTTPStatus.OK and response.text is not None:
        lines = response.text.split("\n")  # there may be thousands; #EXTINF lines have no URI
        response.text = "\n".join(
            [line if line.startswith("#EXTINF") else _with_query(line, query) for line in lines]
        )
    return response


def _with_query(line: str, query: str) -> str:
    if line.startswith("#"):
        return _URI.sub(lambda match: _append(match[0], query), line)
    return _append(line, query) if line else line


def _append(uri: str, query: str) -> str:
    return f"{uri}{'&' if '?' in uri else '?'}{query}"
