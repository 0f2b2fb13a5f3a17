"""The page's arithmetic, module by module, in the browser that will run it."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any

import pytest
import pytest_asyncio
from page_browser import needs_chromium
from page_pattern import FPS, GOP
from page_site import STARTS_AT, FakeSite, SiteServer, serving
from playwright.async_api import Browser, Page

from benchmarks.browser import chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="module")]

FIRST = STARTS_AT - STARTS_AT % GOP


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def browser() -> AsyncIterator[Browser]:
    async with chromium() as running:
        yield running


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def server() -> AsyncIterator[SiteServer]:
    async with serving(FakeSite(people={})) as running:
        yield running


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def page(browser: Browser, server: SiteServer) -> AsyncIterator[Page]:
    opened = await browser.new_page(bypass_csp=True)
    await opened.goto(server.url)
    yield opened
    await opened.close()


async def run(page: Page, module: str, code: str) -> Any:
    """Run code with a module's exports as `m`."""
    return await page.evaluate(f"(async () => {{ const m = await import('/page/{module}'); {code} }})()")


async def simulated(page: Page, *, behind: float, burst: float, seconds: float) -> list[dict[str, Any]]:
    """Play against a stream that arrives `burst` seconds at a time; give time, rate and lead per tenth."""
    log: list[dict[str, Any]] = await run(
        page,
        "pace.js",
        f"""
        const pace = new m.Pace();
        const log = [];
        let time = 0;
        for (let now = 0; now < {seconds}; now += 0.1) {{
          const end = {behind} + Math.floor(now / {burst} + 1e-9) * {burst};
          const step = pace.step(now, time, [[-100, end]]);
          log.push({{ now, rate: step.rate, seek: step.seek, lead: end - time }});
          time = Math.min(end, step.seek ?? time + 0.1 * step.rate);
        }}
        return log;
        """,
    )
    return log


@pytest.mark.parametrize("burst", [0.04, 0.4, 1.0])
@pytest.mark.parametrize("behind", [0.0, 0.3, 2.5])
async def test_the_player_settles_close_to_live_without_standing(
    page: Page, behind: float, burst: float
) -> None:
    log = await simulated(page, behind=behind + burst, burst=burst, seconds=40)
    late = [step for step in log if step["now"] > 25]
    assert min(step["lead"] for step in late) > 0.02
    assert min(step["lead"] for step in late) < 0.2
    jumps = [step for step in log if step["seek"] is not None]
    assert bool(jumps) == (behind + burst > 3)


async def test_far_behind_the_player_jumps(page: Page) -> None:
    log = await simulated(page, behind=20, burst=0.4, seconds=1)
    assert log[0]["seek"] == pytest.approx(20 - 0.08)
    assert all(step["seek"] is None for step in log[1:])


async def test_a_rough_network_is_kept_further_away_from(page: Page) -> None:
    jumped = await run(
        page,
        "pace.js",
        """
        const pace = new m.Pace();
        for (let i = 0; i < 8; i += 1) pace.stalled();
        return pace.step(0, 0, [[0, 9]]).seek;
        """,
    )
    assert 8 < jumped < 9 - 0.5


@pytest.mark.parametrize(
    ("time", "ranges", "seek"),
    [
        (4.99, [[0, 5], [5.2, 8]], 5.201),
        (5.1, [[0, 5], [5.2, 8]], 5.201),
        (3, [[0, 5], [5.2, 6]], None),
        (1, [[2, 3]], 2.001),
        (4, [[2, 3]], None),
        (4, [], None),
    ],
)
async def test_only_a_hole_right_ahead_is_jumped(
    page: Page, time: float, ranges: list[list[float]], seek: float | None
) -> None:
    step = await run(page, "pace.js", f"return new m.Pace().step(0, {time}, {ranges}).seek;")
    assert step == pytest.approx(seek)


@pytest.mark.parametrize("size", [1, 7, 1000, 65_536])
async def test_a_stream_is_cut_into_the_same_segments_however_it_arrives(page: Page, size: int) -> None:
    cut = await run(
        page,
        "mp4.js",
        f"""
        const response = await fetch('/recording.mp4?first={FIRST}&end={FIRST + 20}');
        const all = new Uint8Array(await response.arrayBuffer());
        const splitter = new m.SegmentSplitter();
        const segments = [];
        for (let at = 0; at < all.length; at += {size}) {{
          segments.push(...splitter.push(all.subarray(at, at + {size})));
        }}
        const joined = m.join(segments.map((s) => s.bytes));
        const same = joined.length === all.length && joined.every((byte, i) => byte === all[i]);
        return {{ same, kinds: segments.map((s) => s.kind), starts: segments.map((s) => s.start) }};
        """,
    )
    assert cut["same"]
    assert cut["kinds"] == ["init"] + 20 * ["media"]
    assert cut["starts"][1:] == [pytest.approx((FIRST + i) / FPS, abs=1e-6) for i in range(20)]


@pytest.mark.parametrize(
    "damage", ["new Array(64).fill(0)", "[...'<html>not found</html>'].map((c) => c.charCodeAt())"]
)
async def test_what_is_no_video_is_refused(page: Page, damage: str) -> None:
    error = await run(
        page,
        "mp4.js",
        f"""
        try {{ new m.SegmentSplitter().push(new Uint8Array({damage})); }}
        catch (error) {{ return error.message; }}
        """,
    )
    assert "not an MP4" in error


async def test_old_video_is_let_go(page: Page) -> None:
    seconds = 90
    ranges = await run(
        page,
        "buffer.js",
        f"""
        const {{ SegmentSplitter, join }} = await import('/page/mp4.js');
        const source = new MediaSource();
        const video = document.createElement('video');
        video.src = URL.createObjectURL(source);
        await new Promise((resolve) => source.addEventListener('sourceopen', resolve));
        const buffer = new m.MediaBuffer(source.addSourceBuffer('video/mp4; codecs="avc1.42C01F"'));
        const response = await fetch('/recording.mp4?first={FIRST}&end={FIRST + seconds * FPS}');
        const segments = new SegmentSplitter().push(new Uint8Array(await response.arrayBuffer()));
        for (let i = 0; i < segments.length; i += 25) {{
          const some = segments.slice(i, i + 25);
          await buffer.append(join(some.map((s) => s.bytes)), some.at(-1).start);
        }}
        return buffer.ranges;
        """,
    )
    assert len(ranges) == 1
    start, end = ranges[0]
    assert end == pytest.approx(FIRST / FPS + seconds, abs=0.1)
    assert 18 < end - start < 30


async def test_decisions_are_kept_for_a_minute_in_order_and_once(page: Page) -> None:
    result = await run(
        page,
        "decisions.js",
        """
        const d = new m.Decisions(25);
        const gop = (first, camera) => ({
          first, frames: 10, choices: { 1: camera }, boxes: { [camera]: [[[1, first, 0, 1, 1]]] }, cuts: [],
        });
        for (let n = 1000; n < 6000; n += 10) d.add(gop(n, n % 100 < 50 ? 'a' : 'b'));
        d.add(gop(5980, 'b'));
        return {
          end: d.end, now: d.camera(1, 5999), repeated: d.boxes('b', 5980), old: d.camera(1, 1000),
          future: d.camera(1, 6000), stranger: d.camera(2, 5999), runs: d.runs(1, 5895),
        };
        """,
    )
    assert result["end"] == 6000
    assert (result["now"], result["old"], result["future"], result["stranger"]) == ("b", None, None, None)
    assert result["repeated"] == [[1, 5980, 0, 1, 1]]
    assert result["runs"] == [
        {"camera": "b", "first": 5895, "end": 5900},
        {"camera": "a", "first": 5900, "end": 5950},
        {"camera": "b", "first": 5950, "end": 6000},
    ]


async def test_the_clock_believes_the_quickest_answer(page: Page) -> None:
    offset = await run(
        page,
        "clock.js",
        """
        const clock = new m.ServerClock();
        clock.add(0, 800, 7);
        clock.add(1000, 1010, 3.505);
        clock.add(0, 90, 9);
        return clock.offset;
        """,
    )
    assert offset == pytest.approx(2500)
