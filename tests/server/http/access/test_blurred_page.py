"""The viewer's page with a token that blurs others: what is shown, and that it asks for nothing refused."""

from __future__ import annotations

import asyncio
import base64
from contextlib import aclosing
from pathlib import Path

import cv2
import numpy as np
from playwright.async_api import Page, expect

from benchmarks.common.browser import chromium
from fakes.http.tokens import token_entry, token_of, write_tokens
from fakes.page.browser import new_page
from fakes.programs import needs_chromium
from fakes.service.blurred import assert_hides_others, shown_camera
from fakes.service.drawn_site import DrawnSite, drawn_room

EPOCH_S = 0.5
"""Slower than real time: the drawn site has pictures for six seconds."""
DISPLAYED = """
() => {
  const frame = new VideoFrame(document.querySelector('#video')), canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [frame.displayWidth, frame.displayHeight];
  canvas.getContext('2d').drawImage(frame, 0, 0);
  const time = frame.timestamp / 1e6;
  frame.close();
  return [time, canvas.toDataURL('image/png').split(',')[1]];
}
"""


async def assert_displayed_frame_hides_others(room: DrawnSite, page: Page) -> None:
    time, png = await page.evaluate(DISPLAYED)
    image = cv2.imdecode(np.frombuffer(base64.b64decode(png), np.uint8), cv2.IMREAD_COLOR)
    pulse = round(time * room.service.config.site.fps)
    assert_hides_others(room, np.asarray(image, np.uint8), shown_camera(room, pulse, 1), pulse, 1)


@needs_chromium
async def test_the_page_plays_the_drawn_stream_and_offers_only_that(tmp_path: Path) -> None:
    path = write_tokens(tmp_path / "tokens.yaml", token_entry("guest"))
    async with chromium() as browser, aclosing(drawn_room(access={"tokens": str(path)})) as rooms:
        room = await anext(rooms)
        page = await new_page(browser, bypass_csp=True)
        refused: list[str] = []
        page.on("response", lambda answer: refused.append(answer.url) if answer.status == 403 else None)
        await page.goto(f"http://127.0.0.1:{room.port}/?object=1#token={token_of('guest')}")
        sending = asyncio.create_task(room.advance_forever(EPOCH_S))
        await page.wait_for_function("myview.state === 'playing' && myview.pulse !== null")
        await assert_displayed_frame_hides_others(room, page)
        await expect(page.locator("#site")).to_contain_text("other people are blurred")
        for key, notice in ((",", "only in live pictures"), ("1", "only in the best view")):
            await page.keyboard.press(key)
            await expect(page.locator("#notice")).to_contain_text(notice)
        for control in ("#live", "#search"):
            await expect(page.locator(control)).to_be_hidden()
        await assert_displayed_frame_hides_others(room, page)
        sending.cancel()
        assert refused == []
