"""Playback of a stream in Chromium through one SourceBuffer, as the page does."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from benchmarks.common.browser import chromium
from fakes.page.browser import new_page
from fakes.timeouts import PATIENCE
from server.service.streaming.splicer import Splicer

READ_JS = """
  const video = document.createElement('video');
  const source = new MediaSource();
  video.muted = true;
  video.src = URL.createObjectURL(source);
  await new Promise((done) => source.addEventListener('sourceopen', done, { once: true }));
  const buffer = source.addSourceBuffer(type);
  buffer.appendBuffer(await (await fetch(url)).arrayBuffer());
  await new Promise((done) => buffer.addEventListener('updateend', done, { once: true }));
  source.endOfStream();
"""
"""JavaScript that reads all of ``url``, of MIME type ``type``, into ``buffer``, which ``video`` shows."""

PLAY_JS = (
    "async ([url, type, rate]) => {"
    + READ_JS
    + """
  const ended = new Promise((done) => video.addEventListener('ended', done, { once: true }));
  const range = [buffer.buffered.start(0), buffer.buffered.end(0)];
  const shown = [];
  const record = (now, { mediaTime }) => { shown.push(mediaTime); video.requestVideoFrameCallback(record); };
  video.requestVideoFrameCallback(record);
  video.currentTime = range[0];
  video.playbackRate = rate;
  await video.play();
  await ended;
  return { ranges: buffer.buffered.length, range, shown, end: video.currentTime,
    error: video.error?.message ?? '',
    tracks: [video.webkitAudioDecodedByteCount > 0, video.webkitVideoDecodedByteCount > 0] };
}"""
)
"""Plays a stream; returns buffered ranges, media times of frames and of the end, and decoded tracks."""


async def play_in_chromium(
    port: int, splicer: Splicer, gops: int, show: Callable[[int], None], script: str, *arguments: Any
) -> dict[str, Any]:
    """Run a script that reads a stream, and publish GOPs once it is connected; return its result."""
    async with chromium() as browser:
        page = await new_page(browser, bypass_csp=True)
        await page.goto(f"http://127.0.0.1:{port}/healthz")
        playing = asyncio.create_task(page.evaluate(script, list(arguments)))
        while not splicer.viewers:  # noqa: ASYNC110 — the browser connects at any time
            await asyncio.sleep(0.01)
        for gop in range(1, gops):
            show(gop)
            await asyncio.sleep(0.01)
        splicer.close()
        async with asyncio.timeout(PATIENCE):
            found: dict[str, Any] = await playing
    return found


NATIVE_HLS_JS = """async (url) => {
  const video = document.createElement('video');
  if (!video.canPlayType('application/vnd.apple.mpegurl')) return null;
  const end = new Promise((done) => {
    video.onended = () => done('ended');
    video.onerror = () => done(video.error.message);
  });
  video.muted = true;
  video.src = url;  // at normal speed, the only one for live streams
  await video.play();
  return { end: await end, seconds: video.currentTime };
}"""
