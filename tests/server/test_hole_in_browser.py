"""Chromium plays on where a camera has nothing to show: to Media Source Extensions there is no hole."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest
from cameras_by_hand import CAMERAS, FPS, GOP, NO_REASON, SMALL, encoded
from halls import A, Hall, opened

from benchmarks.browser import CHROMIUM, chromium
from server.view.decide import GopDecision, ObjectChoice

GOPS = 12
SILENT = (4, 5, 6, 9)
LOST = 53
"""A pulse whose picture is lost, in a GOP of which the others have come."""

PLAY = """async ([url, codec]) => {
  const video = document.createElement('video');
  const source = new MediaSource();
  video.muted = true;
  video.src = URL.createObjectURL(source);
  await new Promise((done) => source.addEventListener('sourceopen', done, { once: true }));
  const buffer = source.addSourceBuffer(`video/mp4; codecs="${codec}"`);
  buffer.appendBuffer(await (await fetch(url)).arrayBuffer());
  await new Promise((done) => buffer.addEventListener('updateend', done, { once: true }));
  source.endOfStream();
  const ended = new Promise((done) => video.addEventListener('ended', done, { once: true }));
  const range = [buffer.buffered.start(0), buffer.buffered.end(0)];
  video.currentTime = range[0];
  video.playbackRate = 4;
  await video.play();
  await ended;
  return { ranges: buffer.buffered.length, range, error: video.error?.message ?? '' };
}"""


@pytest.fixture
async def hall() -> AsyncIterator[Hall]:
    """A site in which whoever watches may be as slow as they like."""
    async for it in opened(http={"viewer_queue_gops": GOPS}):
        yield it


@pytest.mark.skipif(not CHROMIUM.exists(), reason=f"needs a Chromium at {CHROMIUM}")
async def test_media_source_extensions_play_over_what_is_missing_to_the_end(hall: Hall) -> None:
    splicer, shelf = hall.service.splicer, hall.service.shelves[A]
    hall.service.come(*CAMERAS)
    hall.service.feed(0, {A: {1: SMALL}})
    for unit in encoded(0, GOPS * GOP):
        if unit.pulse // GOP not in SILENT and unit.pulse != LOST:
            shelf.put(unit.pulse, 1, unit.data, key=unit.key)

    def show(gop: int) -> None:
        choice = ObjectChoice(1, A if shelf.has(gop * GOP) else None, None, away=False)
        splicer.decision(GopDecision(gop * GOP, GOP, (choice,), {}, {}, (), NO_REASON))

    show(0)
    parameters = hall.service.agreement.parameters
    assert parameters is not None
    async with chromium() as browser:
        page = await browser.new_page(bypass_csp=True)
        await page.goto(f"http://127.0.0.1:{hall.port}/healthz")
        playing = asyncio.create_task(page.evaluate(PLAY, ["/objects/1/best.mp4", parameters.codec]))
        while not splicer.viewers:  # noqa: ASYNC110 — the browser comes when it comes
            await asyncio.sleep(0.01)
        for gop in range(1, GOPS):
            show(gop)
            await asyncio.sleep(0.01)
        splicer.close()
        async with asyncio.timeout(60):
            seen = await playing
    assert (seen["error"], seen["ranges"]) == ("", 1)
    assert seen["range"] == [0, pytest.approx(GOPS * GOP / FPS)]
