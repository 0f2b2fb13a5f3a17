"""Parsing and buffering of a stream's bytes, in a browser. Modules without the DOM are tested in units/."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page

from fakes.page.browser import new_page
from fakes.page.site import FIRST_PULSE, FakeSite, SiteServer, serving
from fakes.page.video_pattern import FPS, GOP
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]

FIRST = FIRST_PULSE - FIRST_PULSE % GOP


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def server() -> AsyncIterator[SiteServer]:
    async with serving(FakeSite(people={})) as running:
        yield running


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def page(browser: Browser, server: SiteServer) -> AsyncIterator[Page]:
    opened = await new_page(browser, bypass_csp=True)
    await opened.goto(server.url)
    yield opened
    await opened.close()


async def run(page: Page, module: str, code: str) -> Any:
    """Run code with a module's exports as `m`."""
    return await page.evaluate(f"(async () => {{ const m = await import('/page/{module}'); {code} }})()")


@pytest.mark.parametrize("size", [1, 7, 1000, 65_536])
async def test_a_stream_is_split_into_the_same_segments_for_any_chunk_size(page: Page, size: int) -> None:
    split = await run(
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
        const joined = m.concat(segments.map((segment) => segment.bytes));
        const same = joined.length === all.length && joined.every((byte, i) => byte === all[i]);
        const [kinds, starts] = ['kind', 'start'].map((key) => segments.map((segment) => segment[key]));
        return {{ same, kinds, starts }};
        """,
    )
    assert split["same"]
    assert split["kinds"] == ["init"] + 20 * ["media"]
    assert split["starts"][1:] == [pytest.approx((FIRST + i) / FPS, abs=1e-6) for i in range(20)]


@pytest.mark.parametrize(
    "damage", ["new Array(64).fill(0)", "[...'<html>not found</html>'].map((c) => c.charCodeAt())"]
)
async def test_data_that_is_not_mp4_is_rejected(page: Page, damage: str) -> None:
    error = await run(
        page,
        "player/media/mp4.js",
        f"""
        try {{ new m.SegmentSplitter().push(new Uint8Array({damage})); }}
        catch (error) {{ return error.message; }}
        """,
    )
    assert "not an MP4" in error


async def test_old_video_is_removed_from_the_buffer(page: Page) -> None:
    seconds = 90
    ranges = await run(
        page,
        "player/media/media_source.js",
        f"""
        const {{ SegmentSplitter, concat }} = await import('/page/player/media/mp4.js');
        const source = new MediaSource();
        const video = document.createElement('video');
        video.src = URL.createObjectURL(source);
        await new Promise((resolve) => source.addEventListener('sourceopen', resolve));
        const buffer = new m.MediaBuffer(source.addSourceBuffer('video/mp4; codecs="avc1.42C01F"'));
        const response = await fetch('/recording.mp4?first={FIRST}&end={FIRST + seconds * FPS}');
        const segments = new SegmentSplitter().push(new Uint8Array(await response.arrayBuffer()));
        for (let i = 0; i < segments.length; i += 25) {{
          const group = segments.slice(i, i + 25);
          await buffer.append(concat(group.map((segment) => segment.bytes)), group.at(-1).start);
        }}
        return buffer.ranges;
        """,
    )
    assert len(ranges) == 1
    start, end = ranges[0]
    assert end == pytest.approx(FIRST / FPS + seconds, abs=0.1)
    assert 18 < end - start < 30
