"""Low-Latency HLS: parts of segments, compared with draft-pantos-hls-rfc8216bis."""

from __future__ import annotations

import asyncio
import io
import re
import subprocess
from collections.abc import AsyncIterator
from dataclasses import dataclass

import aiohttp
import av
import numpy as np
import pytest
from numpy.typing import NDArray

from fakes.programs import needs_ffmpeg
from fakes.service.fed_site import A, ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, NO_REASON, encoded, video
from fakes.timeouts import PATIENCE
from server.http.hls.live_playlist import _cached
from server.service.streaming.hls_segmenter import HlsSegmenter
from server.service.view_selection.decider import GopDecision, ObjectChoice

HTTP = {"hls_segment_s": 0.6, "hls_window_s": 6.0}
PARTS = 3
"""GOPs in a segment."""
TARGET = GOP / FPS
STREAM = "/objects/1/hls/"
FRAMES = 250


@pytest.fixture
async def served() -> AsyncIterator[ServedSite]:
    """A site whose segments have three parts."""
    async for served in serve_site(http=HTTP):
        served.service.connect_cameras(*CAMERAS)
        yield served


def decide_gops(served: ServedSite, gops: range, without_pictures: frozenset[int] = frozenset()) -> None:
    """Decide GOPs of person 1 in alternating cameras, some without pictures."""
    for gop in gops:
        for seed, camera in enumerate(CAMERAS if gop not in without_pictures else ()):
            for unit in encoded(seed, FRAMES)[gop * GOP : (gop + 1) * GOP]:
                served.service.ingest.receive_video(video(camera, unit))
        choice = ObjectChoice(1, None if gop in without_pictures else CAMERAS[gop % 2], None, departed=False)
        served.service.splicer.publish_decision(GopDecision(gop * GOP, GOP, (choice,), {}, {}, (), NO_REASON))


async def fetch_playlist(served: ServedSite, query: str = "") -> str:
    async with served.session.get(f"{STREAM}index.m3u8{query}") as answer:
        assert answer.status == 200, await answer.text()
        return await answer.text()


async def fetch_segment(served: ServedSite, uri: str) -> bytes:
    async with served.session.get(STREAM + uri) as answer:
        assert answer.status == 200, await answer.text()
        assert answer.headers["Cache-Control"].endswith("immutable")
        return await answer.read()


@dataclass(frozen=True)
class Part:
    duration: float
    uri: str
    independent: bool


@dataclass(frozen=True)
class ParsedPlaylist:
    """A playlist as a player that knows parts reads it."""

    sequence: int
    whole: dict[int, float]
    """Seconds of whole segments, by number."""
    parts: dict[int, list[Part]]
    hint: str | None


def parse_playlist(text: str) -> ParsedPlaylist:
    """Parse a playlist, and check the rules of the draft."""
    target = int(find_one(text, r"#EXT-X-TARGETDURATION:(\d+)"))
    part_target = float(find_one(text, r"#EXT-X-PART-INF:PART-TARGET=([\d.]+)"))
    control = find_one(text, r"#EXT-X-SERVER-CONTROL:(.*)")
    assert "CAN-BLOCK-RELOAD=YES" in control, "4.4.3.8"
    assert float(find_one(control, r"PART-HOLD-BACK=([\d.]+)")) >= 3 * part_target - 1e-9, "4.4.3.8"
    assert text.index("#EXT-X-PART-INF") < text.index("#EXTINF"), "4.4.3.7"
    number = sequence = int(find_one(text, r"#EXT-X-MEDIA-SEQUENCE:(\d+)"))
    whole: dict[int, float] = {}
    parts: dict[int, list[Part]] = {}
    duration = 0.0
    for line in text.splitlines():
        if line.startswith("#EXT-X-PART:"):
            match = re.fullmatch(r'#EXT-X-PART:DURATION=([\d.]+),URI="([^"]+)"(,INDEPENDENT=YES)?', line)
            assert match, line
            part = Part(float(match[1]), match[2], bool(match[3]))
            parts.setdefault(number, []).append(part)
            assert part.duration <= part_target, "4.4.4.9"
        elif line.startswith("#EXTINF:"):
            duration = float(line[8:-1])
        elif line and not line.startswith("#"):
            whole[number] = duration
            number += 1
    for segment, its in parts.items():
        assert its[0].independent, "4.4.3.5: segments are independent, and so are their first parts"
        assert all(part.duration >= 0.85 * part_target for part in its[:-1]), "4.4.4.9"
        if segment in whole:
            assert sum(part.duration for part in its) == pytest.approx(whole[segment], abs=1e-4), "4.4.4.9"
    until = sum(whole.values()) + sum(part.duration for part in parts.get(number, []))
    for segment in whole:
        behind = until - sum(seconds for other, seconds in whole.items() if other <= segment)
        assert (segment in parts) == (behind < 3 * target - 1e-6), "6.2.2: parts are near the end"
    hint = re.search(r'^#EXT-X-PRELOAD-HINT:TYPE=PART,URI="([^"]+)"$', text, re.MULTILINE)
    return ParsedPlaylist(sequence, whole, parts, hint and hint[1])


def find_one(text: str, pattern: str) -> str:
    (match,) = re.findall(pattern, text)
    return str(match)


async def test_playlists_follow_the_draft_and_grow_part_by_part(served: ServedSite) -> None:
    decide_gops(served, range(PARTS))
    before = parse_playlist(await fetch_playlist(served))
    for gop in range(PARTS, 45):
        decide_gops(served, range(gop, gop + 1))
        now = parse_playlist(await fetch_playlist(served))
        newest = [part for its in now.parts.values() for part in its]
        assert newest[-1].uri == before.hint, "the hinted part is the next one"
        assert now.sequence >= before.sequence
        for number, seconds in before.whole.items():
            assert now.whole.get(number, seconds) == seconds
        for number, its in before.parts.items():
            assert now.parts.get(number, its)[: len(its)] == its, "6.2.1: immutable"
        before = now
    served.service.splicer.close()
    assert parse_playlist(await fetch_playlist(served)).hint is None


async def test_a_playlist_is_written_once_per_part_for_all_players(served: ServedSite) -> None:
    decide_gops(served, range(PARTS))
    segmenter = served.service.splicer.segmenter_of_person(1)
    assert segmenter is not None
    texts = [_cached(segmenter, pulse0) for pulse0 in (None, None, 1_800_000_000.0)]
    assert texts[0] is texts[1]
    assert texts[1] != texts[2], "the wall-clock time is known now"
    decide_gops(served, range(PARTS, PARTS + 1))
    assert _cached(segmenter, 1_800_000_000.0) not in texts
    segmenter.end()
    assert _cached(segmenter, 1_800_000_000.0).endswith("#EXT-X-ENDLIST\n")


async def test_a_blocked_request_is_answered_when_its_part_exists(served: ServedSite) -> None:
    decide_gops(served, range(PARTS + 1))
    waiting = {
        query: asyncio.create_task(fetch_playlist(served, query))
        for query in ("?_HLS_msn=1&_HLS_part=1", "?_HLS_msn=1", "?_HLS_msn=1&_HLS_part=3")
    }
    part = asyncio.create_task(fetch_segment(served, "1.1.m4s"))
    at_once = parse_playlist(await fetch_playlist(served, "?_HLS_msn=1&_HLS_part=0"))
    assert [part.uri for part in at_once.parts[1]] == ["1.0.m4s"]
    assert not any(task.done() for task in (*waiting.values(), part))
    decide_gops(served, range(PARTS + 1, PARTS + 2))
    first = parse_playlist(await waiting.pop("?_HLS_msn=1&_HLS_part=1"))
    assert [part.uri for part in first.parts[1]] == ["1.0.m4s", "1.1.m4s"]
    assert await part == await fetch_segment(served, "1.1.m4s")
    decide_gops(served, range(PARTS + 2, PARTS + 3))
    assert 1 in parse_playlist(await waiting.pop("?_HLS_msn=1")).whole
    (last,) = waiting.values()
    await fetch_playlist(served)
    assert not last.done(), "a part beyond the last of a segment is the first of the next (6.2.5.2)"
    decide_gops(served, range(PARTS + 3, PARTS + 4))
    assert [part.uri for part in parse_playlist(await last).parts[2]] == ["2.0.m4s"]


async def test_the_end_of_a_stream_answers_blocked_requests(served: ServedSite) -> None:
    decide_gops(served, range(2 * PARTS))
    waiting = asyncio.create_task(fetch_playlist(served, "?_HLS_msn=2&_HLS_part=0"))
    part = asyncio.create_task(served.get(STREAM + "2.0.m4s"))
    await fetch_playlist(served)
    served.service.splicer.close()
    assert (await waiting).endswith("#EXT-X-ENDLIST\n")
    assert (await part)[0] == 404


@pytest.mark.parametrize(
    ("query", "error"),
    [
        ("_HLS_part=1", "_HLS_part: needs _HLS_msn, the number of its segment"),
        ("_HLS_msn=x", "_HLS_msn=x: must be a whole number"),
        ("_HLS_msn=1&_HLS_part=-1", "_HLS_part=-1: must be a whole number"),
        ("_HLS_msn=99", "_HLS_msn=99: is too far ahead; the newest segment is 1"),
    ],
)
async def test_an_invalid_blocking_request_is_refused_with_one_line(
    served: ServedSite, query: str, error: str
) -> None:
    decide_gops(served, range(PARTS + 1))
    assert await served.get(f"{STREAM}index.m3u8?{query}") == (400, {"error": error})
    assert (await served.get(STREAM + "7.0.m4s"))[0] == 404


async def test_a_blocked_request_times_out(served: ServedSite, monkeypatch: pytest.MonkeyPatch) -> None:
    decide_gops(served, range(PARTS + 1))
    monkeypatch.setattr("server.http.hls.live_playlist._MAX_BLOCK", 0.05)
    async with served.session.get(f"{STREAM}index.m3u8?_HLS_msn=2") as answer:
        assert (answer.status, bool(answer.headers["Retry-After"])) == (503, True)


def decoded(data: bytes) -> dict[int, NDArray[np.uint8]]:
    """Decode: each pulse and the last picture in it."""
    with av.open(io.BytesIO(data), "r") as container:
        frames = list(container.decode(video=0))
    return {round(float(frame.time or 0) * FPS): frame.to_ndarray(format="yuv420p") for frame in frames}


def picture_at(shown: dict[int, NDArray[np.uint8]], pulse: int) -> NDArray[np.uint8]:
    """Return the picture displayed at a pulse; it may be an earlier one."""
    return shown[max(earlier for earlier in shown if earlier <= pulse)]


def is_independent(segmenter: HlsSegmenter, gop: int) -> bool:
    part = segmenter.part(gop // PARTS, gop % PARTS)
    return part is not None and part.independent


async def test_parts_equal_their_segments_and_independent_ones_are_decodable(
    served: ServedSite,
) -> None:
    gops = 8 * PARTS
    decide_gops(served, range(gops), without_pictures=frozenset({5, 6, 7, 10, 13, 14, 15, 16}))
    init = await fetch_segment(served, "init.mp4")
    numbers = range(1, gops // PARTS)
    segments = decoded(init + b"".join([await fetch_segment(served, f"{number}.m4s") for number in numbers]))
    uris = [(f"{number}.{part}.m4s", number * PARTS + part) for number in numbers for part in range(PARTS)]
    together = decoded(init + b"".join([await fetch_segment(served, uri) for uri, _ in uris]))
    for pulse in range(PARTS * GOP, gops * GOP):
        np.testing.assert_array_equal(picture_at(together, pulse), picture_at(segments, pulse), str(pulse))
    segmenter = served.service.splicer.segmenter_of_person(1)
    assert segmenter is not None
    alone = [
        (uri, gop)
        for uri, gop in uris
        if (part := segmenter.part(gop // PARTS, gop % PARTS)) and part.independent
    ]
    assert len(alone) == len(uris) - 4, "not after a gap inside a segment"
    for uri, gop in alone:
        for pulse, picture in decoded(init + await fetch_segment(served, uri)).items():
            assert gop * GOP <= pulse < (gop + 1) * GOP
            np.testing.assert_array_equal(picture, picture_at(segments, pulse), uri)


@needs_ffmpeg
async def test_ffmpeg_ignores_parts_and_plays_without_a_warning(served: ServedSite) -> None:
    decide_gops(served, range(4 * PARTS + 1))
    url = f"http://127.0.0.1:{served.port}{STREAM}index.m3u8"
    command = ["ffmpeg", "-v", "error", "-live_start_index", "0", "-i", url, "-f", "framecrc", "-"]
    playing = asyncio.create_task(
        asyncio.to_thread(
            subprocess.run, command, capture_output=True, text=True, timeout=PATIENCE, check=False
        )
    )
    for gop in range(4 * PARTS + 1, 8 * PARTS):
        decide_gops(served, range(gop, gop + 1))
        await asyncio.sleep(0.02)
    served.service.splicer.close()
    completed = await playing
    assert (completed.returncode, completed.stderr) == (0, "")
    assert sum(not line.startswith("#") for line in completed.stdout.splitlines()) == 8 * PARTS * GOP


async def test_short_gops_are_no_parts_but_requests_can_block_for_segments() -> None:
    async for served in serve_site(http=HTTP, encode={"gop_s": 0.08}, view={"lookahead_s": 0.4}):
        served.service.connect_cameras(*CAMERAS)
        gops = 40
        for camera in CAMERAS:
            for unit in encoded(0, 100, gop=2)[: 2 * gops]:
                served.service.ingest.receive_video(video(camera, unit))
        choice = ObjectChoice(1, A, None, departed=False)
        decisions = [GopDecision(2 * gop, 2, (choice,), {}, {}, (), NO_REASON) for gop in range(gops)]
        for decision in decisions[: gops // 2]:
            served.service.splicer.publish_decision(decision)
        waiting = asyncio.create_task(fetch_playlist(served, "?_HLS_msn=3"))
        now = await fetch_playlist(served)
        assert "CAN-BLOCK-RELOAD=YES\n" in now
        assert "PART" not in now
        assert "3.m4s" not in now
        for decision in decisions[gops // 2 :]:
            served.service.splicer.publish_decision(decision)
        assert "3.m4s" in await waiting
        assert (await served.get(STREAM + "5.0.m4s"))[0] == 404


async def test_a_camera_has_parts_too(served: ServedSite) -> None:
    decide_gops(served, range(2 * PARTS + 1))
    async with served.session.get(f"/cameras/{A}/hls/index.m3u8") as answer:
        assert [part.uri for part in parse_playlist(await answer.text()).parts[2]] == ["2.0.m4s"]
    async with served.session.get(f"/cameras/{A}/hls/2.0.m4s") as answer:
        assert (await answer.read())[4:8] == b"moof"
    async with aiohttp.ClientSession() as other:
        url = f"http://127.0.0.1:{served.port}/cameras/{A}/hls/2.9.m4s"
        async with other.get(url) as answer:
            assert answer.status == 404
