"""What the page makes of a stream's bytes, in a browser. Its arithmetic is tested without one: units/."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page

from fakes.page.site import STARTS_AT, FakeSite, SiteServer, serving
from fakes.page.video_pattern import FPS, GOP
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]

FIRST = STARTS_AT - STARTS_AT % GOP


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def server() -> AsyncIterator[SiteServer]:
    async with serving(FakeSite(people={})) as running:
        yield running


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def page(browser: Browser, server: SiteServer) -> AsyncIterator[Page]:
    opened = await browser.new_page(bypass_csp=True)
    await opened.goto(server.url)
    yield opened
    await opened.close()


async def run(page: Page, module: str, code: str) -> Any:
    """Run code with a module's exports as `m`."""
    return await page.evaluate(f"(async () => {{ const m = await import('/page/{module}'); {code} }})()")


@pytest.mark.parametrize("size", [1, 7, 1000, 65_536])
async def test_a_stream_is_cut_into_the_same_segments_however_it_arrives(page: Page, size: int) -> None:
    cut = await run(
        page,
        "player/media/mp4.js",
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
        "player/media/mp4.js",
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
        "player/media/buffer.js",
        f"""
        const {{ SegmentSplitter, join }} = await import('/page/player/media/mp4.js');
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
