"""Time-shift playlists are limited: one of a day would take a second to write."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from datetime import datetime
from pathlib import Path

import pytest

from fakes.http.hls_recording import (
    GOPS,
    HTTP_SETTINGS,
    SEGMENT_FRAMES,
    decide_gops,
    drop_from_memory,
    fetch_text,
    segment_numbers,
    wait_until_written,
)
from fakes.service.fed_site import ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, FPS
from fakes.service.scripted_recordings import PULSE0
from server.http.hls import time_shift_playlist
from server.http.hls.time_shift_playlist import (
    MAX_GROWING_SEGMENTS,
    trim_growing_playlist,
    write_time_shift_playlist,
)
from server.service.streaming.hls_segmenter import segment_layout
from server.service.time_shift.hls_time_shift import SegmentList

PLAN = segment_layout(FPS, SEGMENT_FRAMES, SEGMENT_FRAMES / FPS, 1.0)


@pytest.fixture
async def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[ServedSite]:
    """Serve a site with short playlists: 8 segments growing, 12 complete, every fourth with a time."""
    monkeypatch.setattr(time_shift_playlist, "MAX_GROWING_SEGMENTS", 8)
    monkeypatch.setattr(time_shift_playlist, "_MAX_SEGMENTS", 12)
    monkeypatch.setattr(time_shift_playlist, "_DATE_INTERVAL", 4)
    async for served in serve_site(
        record={"folder": str(tmp_path / "kept"), "segment_s": 1.0}, http=HTTP_SETTINGS
    ):
        served.service.recorder.open()
        served.service.connect_cameras(*CAMERAS)
        yield served


def dated(playlist: str) -> dict[int, datetime]:
    """Return the wall-clock times by segment."""
    found = re.findall(r"^#EXT-X-PROGRAM-DATE-TIME:(.*)\n#EXTINF.*\n(\d+)\.m4s$", playlist, re.MULTILINE)
    return {int(number): datetime.fromisoformat(when) for when, number in found}


def entries(playlist: str) -> dict[int, str]:
    """Return the lines of each segment."""
    found = re.findall(r"((?:#EXT-X-P.*\n)?#EXTINF.*\n)(\d+)\.m4s$", playlist, re.MULTILINE)
    return {int(number): lines for lines, number in found}


async def test_a_growing_playlist_drops_its_oldest_segments(served: ServedSite) -> None:
    path = "/objects/1/hls/index.m3u8?from=p10&to=live"
    before: dict[int, str] = {}
    decide_gops(served, range(7))
    for gop in range(7, GOPS):
        decide_gops(served, range(gop, gop + 1))
        listed = await fetch_text(served, path)
        first = segment_numbers(listed)[0]
        assert len(segment_numbers(listed)) <= 8
        assert f"#EXT-X-MEDIA-SEQUENCE:{first}\n" in listed
        kept = {number: lines for number, lines in before.items() if number >= first}
        assert kept.items() <= entries(listed).items(), "listed segments do not change"
        before = entries(listed)
    assert list(before) == list(range(12, 20))


async def test_a_playlist_has_no_type_since_deleted_segments_leave_it(served: ServedSite) -> None:
    decide_gops(served, range(16))
    await wait_until_written(served, 16)
    drop_from_memory(served)
    run = served.service.recorder.session
    assert run is not None
    for query in ("from=p10&to=live", "from=p10&to=p80"):
        path = f"/objects/1/hls/index.m3u8?{query}"
        before = await fetch_text(served, path)
        assert "PLAYLIST-TYPE" not in before
        assert segment_numbers(before)[0] == 1
    run.delete(run.segments[:2])
    for query in ("from=p10&to=live", "from=p10&to=p80"):
        after = await fetch_text(served, f"/objects/1/hls/index.m3u8?{query}")
        assert segment_numbers(after)[0] == 5
        assert "#EXT-X-MEDIA-SEQUENCE:5\n" in after


@pytest.mark.parametrize(
    ("query", "names"),
    [
        ("from=-1.2", "from=p170&to=live"),
        ("from=p170", "from=p170&to=live"),
        ("from=p115", "from=p115&to=p200"),
        ("from=p5", "from=p5&to=p120"),
        ("from=-2&to=p220", "from=p150&to=p220"),
        ("from=-2&to=live", "from=p150&to=live"),
    ],
)
async def test_a_request_without_an_end_is_answered_with_a_playlist_of_allowed_length(
    served: ServedSite, query: str, names: str
) -> None:
    decide_gops(served, range(GOPS))
    await wait_until_written(served, GOPS)
    master = await fetch_text(served, f"/objects/1/hls/index.m3u8?{query}")
    assert master.splitlines()[-1] == f"index.m3u8?{names}"
    listed = segment_numbers(await fetch_text(served, f"/objects/1/hls/{master.splitlines()[-1]}"))
    assert 0 < len(listed) <= 12


@pytest.mark.parametrize(
    ("query", "error"),
    [
        ("from=p5&to=p121", "to: a playlist has 12 segments at most, here 5 s; use to=p120"),
        ("from=-9&to=-1", "to: a playlist has 12 segments at most, here 5 s; use to=p120"),
        (
            "from=p170&to=p260",
            "to: a growing playlist has 8 segments at most, here 3 s; use to=live or to=p250",
        ),
        (
            "from=p170&to=p9999999999999",
            "to: a growing playlist has 8 segments at most, here 3 s; use to=live or to=p250",
        ),
    ],
)
async def test_a_playlist_that_would_be_too_long_is_refused_with_an_alternative(
    served: ServedSite, query: str, error: str
) -> None:
    decide_gops(served, range(GOPS))
    await wait_until_written(served, GOPS)
    assert await served.get(f"/objects/1/hls/index.m3u8?{query}") == (400, {"error": error})


async def test_only_hls_accepts_live_as_an_end(served: ServedSite) -> None:
    decide_gops(served, range(GOPS))
    status, answer = await served.get("/objects/1/best.mp4?from=p5&to=live")
    assert (status, answer["error"][:22]) == (400, "to: 'live' is not a ti")


def test_the_first_segment_and_every_64th_have_a_wall_clock_time() -> None:
    listing = SegmentList(range(100, 400), PLAN.segment_frames, 1003, 3996)
    listed = write_time_shift_playlist(listing, PLAN, PULSE0, ended=True)
    assert segment_numbers(listed) == list(range(100, 400))
    times = {number: when.timestamp() for number, when in dated(listed).items()}
    pulses = {100: 1003} | {number: number * PLAN.segment_frames for number in (128, 192, 256, 320, 384)}
    assert times == pytest.approx({number: PULSE0 + pulse / FPS for number, pulse in pulses.items()})
    lengths = [float(seconds) for seconds in re.findall(r"#EXTINF:([\d.]+),", listed)]
    assert lengths == [7 / FPS, *[10 / FPS] * 298, 6 / FPS]


@pytest.mark.parametrize("stop", range(MAX_GROWING_SEGMENTS + 100, MAX_GROWING_SEGMENTS + 300, 7))
def test_the_first_segment_after_trimming_had_a_wall_clock_time_before(stop: int) -> None:
    whole = SegmentList(range(100, stop), PLAN.segment_frames, 1000, stop * PLAN.segment_frames)
    trimmed = trim_growing_playlist(whole)
    assert MAX_GROWING_SEGMENTS - 64 < len(trimmed.numbers) <= MAX_GROWING_SEGMENTS
    before, after = (
        entries(write_time_shift_playlist(listing, PLAN, PULSE0, ended=False)) for listing in (whole, trimmed)
    )
    assert after.items() <= before.items()
