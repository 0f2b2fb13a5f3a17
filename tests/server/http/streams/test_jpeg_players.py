"""Players of rendered streams: <img> and <video> in Chromium, and ffmpeg."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest

from benchmarks.common.browser import chromium
from fakes.page.browser import new_page
from fakes.programs import needs_chromium, needs_ffmpeg
from fakes.service.drawn_site import DrawnSite, drawn_room
from fakes.service.scripted_cameras import FPS, GOP

LOOKS = """
async () => {
  const [image] = document.images, canvas = document.createElement('canvas'), seen = new Set();
  canvas.width = image.naturalWidth; canvas.height = image.naturalHeight;
  const paper = canvas.getContext('2d', {willReadFrequently: true});
  for (const end = performance.now() + 8000; performance.now() < end && seen.size < 6;) {
    paper.drawImage(image, 0, 0);
    seen.add(paper.getImageData(0, 0, canvas.width, canvas.height).data.reduce((a, b) => (31 * a + b) | 0));
    await new Promise((next) => setTimeout(next, 20));
  }
  return {size: [canvas.width, canvas.height], pictures: seen.size};
}
"""
PLAYS = """
async (address) => {
  const video = document.body.appendChild(document.createElement('video'));
  video.muted = true; video.src = address;
  await video.play();
  await new Promise((seen) => video.requestVideoFrameCallback(seen));
  const from = video.currentTime;
  while (video.currentTime < from + 0.2) await new Promise((next) => setTimeout(next, 20));
  return [video.videoWidth, video.videoHeight];
}
"""


@pytest.fixture
async def moving_site() -> AsyncIterator[DrawnSite]:
    """A site that runs in real time."""
    async for drawn in drawn_room():
        task = asyncio.create_task(drawn.advance_forever(GOP / FPS))
        yield drawn
        task.cancel()


@needs_chromium
async def test_chromium_shows_moving_pictures_in_an_img_and_boxes_in_a_video() -> None:
    async with chromium() as browser:
        async for drawn in drawn_room():
            page = await new_page(browser)
            await page.goto(f"http://127.0.0.1:{drawn.port}/healthz")
            sending = asyncio.create_task(drawn.advance_forever(GOP / FPS))
            await page.evaluate(
                "(path) => new Promise((done) => { const image = new Image(); image.onload = done;"
                " image.src = path; document.body.append(image); })",
                "/objects/1/best.mjpeg?overlay=1",
            )
            assert await page.evaluate(LOOKS) == {"size": [320, 180], "pictures": 6}
            assert await page.evaluate(PLAYS, "/objects/1/best.mp4?overlay=1") == [320, 180]
            sending.cancel()


@needs_ffmpeg
@pytest.mark.parametrize("path", ["/cameras/c0/live.mjpeg", "/objects/1/best.mp4?overlay=1"])
async def test_ffmpeg_reads_mjpeg_without_a_warning(moving_site: DrawnSite, path: str) -> None:
    reading = await asyncio.create_subprocess_exec(
        *("ffmpeg", "-v", "warning", "-nostdin", "-i", f"http://127.0.0.1:{moving_site.port}{path}"),
        *("-frames:v", "15", "-f", "framecrc", "-"),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    out, warnings = await reading.communicate()
    assert warnings.decode() == ""
    assert sum(not line.startswith(b"#") for line in out.splitlines()) == 15
