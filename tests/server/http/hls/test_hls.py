"""HLS over HTTP, compared with RFC 8216 and the expectations of players."""

from __future__ import annotations

import re
from datetime import datetime
from itertools import pairwise

import pytest

from fakes.service.fed_site import A, B, ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, LARGE, SMALL

SEGMENT = "hls/index.m3u8"


async def text_of(served: ServedSite, path: str) -> str:
    async with served.session.get(path) as answer:
        assert answer.status == 200, await answer.text()
        assert answer.content_type == "application/vnd.apple.mpegurl"
        assert answer.headers["Access-Control-Allow-Origin"] == "*"
        return await answer.text()


def tag(text: str, name: str) -> str:
    (value,) = re.findall(rf"^#EXT-X-{name}:(.*)$", text, re.MULTILINE)
    return str(value)


def entries(text: str) -> list[tuple[float, str, datetime]]:
    """Return each segment's duration, URL and wall-clock time, and check the rules of RFC 8216."""
    assert text.startswith("#EXTM3U\n"), "4.3.1.1"
    assert text.endswith("\n")
    assert "\r" not in text
    assert int(tag(text, "VERSION")) >= 7, "4.3.1.2, 7: fragmented MP4, and EXT-X-MAP"
    assert text.count("#EXT-X-INDEPENDENT-SEGMENTS\n") == 1
    assert text.index("#EXT-X-MEDIA-SEQUENCE") < text.index("#EXTINF"), "4.3.3.2"
    assert text.index("#EXT-X-MAP") < text.index("#EXTINF"), "4.3.2.5"
    assert not re.search(r"#EXT-X-(STREAM-INF|MEDIA:|PLAYLIST-TYPE)", text), "4.3.4: a media playlist, live"
    whole = re.sub(r"^#EXT-X-PART:.*\n", "", text, flags=re.MULTILINE)
    found = re.findall(r"^#EXT-X-PROGRAM-DATE-TIME:(\S+)\n#EXTINF:([\d.]+),\n(\S+)$", whole, re.MULTILINE)
    assert len(found) == text.count("#EXTINF")
    target = int(tag(text, "TARGETDURATION"))
    listed = [(float(seconds), uri, datetime.fromisoformat(when)) for when, seconds, uri in found]
    assert all(int(seconds + 0.5) <= target for seconds, _, _ in listed), "4.3.3.1"
    for (seconds, _, when), (_, _, later) in pairwise(listed):
        assert abs((later - when).total_seconds() - seconds) < 0.002, "4.3.2.6: clocks agree"
    return listed


def feed(served: ServedSite, epochs: range) -> None:
    """Feed a person who is larger in alternating cameras, which causes cuts."""
    for epoch in epochs:
        served.service.feed(
            epoch, {A: {1: SMALL}, B: {1: LARGE}} if epoch % 4 < 2 else {A: {1: LARGE}, B: {1: SMALL}}
        )


@pytest.mark.parametrize("path", ["/objects/1/hls/", "/cameras/c0/hls/"])
async def test_playlists_change_only_as_the_rfc_allows(path: str) -> None:
    async for served in serve_site(http={"hls_segment_s": 0.2, "hls_window_s": 0.6}):
        served.service.pulses.pulse0 = 1_800_000_000.0
        served.service.connect_cameras(*CAMERAS)
        before: list[tuple[float, str, datetime]] = []
        number, target = 0, ""
        for epoch in range(8):
            feed(served, range(epoch, epoch + 1))
            if epoch < 2:
                continue
            text = await text_of(served, path + "index.m3u8")
            listed, sequence = entries(text), int(tag(text, "MEDIA-SEQUENCE"))
            assert 1 <= len(listed) <= 3
            if before:
                assert tag(text, "TARGETDURATION") == target, "4.3.3.1: it must not change"
                assert sequence >= number
                kept = before[sequence - number :]
                assert listed[: len(kept)] == kept, "6.2.1: lines are only added, and removed from the top"
            before, number, target = listed, sequence, tag(text, "TARGETDURATION")
            assert [uri for _, uri, _ in listed] == [f"{sequence + n}.m4s" for n in range(len(listed))]
            assert "ENDLIST" not in text
        assert number > 0, "the window has moved"
        served.service.splicer.close()
        assert (await text_of(served, path + "index.m3u8")).endswith("#EXT-X-ENDLIST\n")


async def test_wall_clock_times_follow_from_pulses(site_with_people: ServedSite) -> None:
    site_with_people.service.pulses.pulse0 = 1_800_000_000.25
    site_with_people.service.splicer.close()
    text = await text_of(site_with_people, "/objects/1/" + SEGMENT)
    assert [when.timestamp() for _, _, when in entries(text)] == [1_800_000_000.25]


async def test_a_segment_is_immutable_and_cacheable(site_with_people: ServedSite) -> None:
    feed(site_with_people, range(3, 8))
    listed = entries_without_time(await text_of(site_with_people, "/objects/1/" + SEGMENT))
    for uri in ["init.mp4", *listed]:
        async with site_with_people.session.get(f"/objects/1/hls/{uri}") as answer:
            data = await answer.read()
            assert answer.content_type == "video/mp4"
            assert answer.headers["Cache-Control"].startswith("public, max-age=")
            assert answer.headers["Cache-Control"].endswith("immutable")
            assert int(answer.headers["Content-Length"]) == len(data) > 100
        async with site_with_people.session.head(f"/objects/1/hls/{uri}") as answer:
            assert int(answer.headers["Content-Length"]) == len(data)
        assert data[4:8] == (b"ftyp" if uri == "init.mp4" else b"moof")
    async with site_with_people.session.get("/objects/1/" + SEGMENT) as answer:
        assert answer.headers["Cache-Control"] == "no-cache"


def entries_without_time(text: str) -> list[str]:
    assert "PROGRAM-DATE-TIME" not in text, "without a pulse the time is unknown"
    return [line for line in text.splitlines() if not line.startswith("#")]


async def test_before_the_first_segment_players_get_503(site_with_people: ServedSite) -> None:
    async with site_with_people.session.get("/objects/1/" + SEGMENT) as answer:
        assert answer.status == 503
        assert int(answer.headers["Retry-After"]) > 0
    feed(site_with_people, range(3, 7))  # a segment is 25 frames here
    assert len(entries_without_time(await text_of(site_with_people, "/objects/1/" + SEGMENT))) == 1


@pytest.mark.parametrize(
    ("path", "error"),
    [
        ("/objects/99/hls/index.m3u8", "there is no object 99"),
        ("/objects/99/hls/init.mp4", "there is no object 99"),
        ("/objects/99/hls/0.m4s", "there is no object 99"),
        ("/cameras/c9/hls/index.m3u8", "there is no camera 'c9'; there are c0, c1"),
        ("/cameras/c0/hls/999.m4s", "no segment 999: expired, or not available yet"),
        ("/cameras/c0/hls/-1.m4s", "there is nothing at /cameras/c0/hls/-1.m4s"),
        ("/cameras/c0/hls/1.ts", "there is nothing at /cameras/c0/hls/1.ts"),
    ],
)
async def test_unknown_segments_get_404(site_with_people: ServedSite, path: str, error: str) -> None:
    assert await site_with_people.get(path) == (404, {"error": error})


async def test_segments_exist_before_the_first_request(site_with_people: ServedSite) -> None:
    feed(site_with_people, range(3, 8))
    async with site_with_people.session.get("/objects/1/hls/0.m4s") as answer:
        assert (await answer.read()).count(b"moof") == FPS // GOP * GOP
