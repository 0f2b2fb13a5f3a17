"""The kinds of viewers of a site: the Python client, a plain player, an HLS player, the page."""

from __future__ import annotations

import asyncio
import contextlib
import re
import time
from itertools import pairwise
from typing import Protocol

import aiohttp
from playwright.async_api import Browser, Page

from benchmarks.common.demo_site import open_when_ready
from benchmarks.faults.video.stamped_views import StampedViews
from benchmarks.faults.viewing.picture_check import GOP_S, PictureVerdict, check_pictures
from benchmarks.faults.viewing.viewers import EventLog, Viewer

_RETRY_S = 0.2
_READ_S = 10.0
"""Seconds without a byte after which plain players give up."""
_PLAYING_MS = 60_000
_SEGMENT = re.compile(r"^#EXTINF:([\d.]+),.*\n(\S+)$", re.MULTILINE)
_FAILURES = (aiohttp.ClientError, OSError, TimeoutError)
_RECORD_STALLS = """() => {
  const video = document.querySelector('video');
  let shown = video.currentTime, since = performance.now();
  window.stalls = [];
  setInterval(() => {
    if (video.currentTime === shown) return;
    const now = performance.now();
    window.stalls.push([Date.now() / 1000, (now - since) / 1000]);
    shown = video.currentTime;
    since = now;
  }, 20);
}"""
"""Records when the page's picture changed, and how long the one before it stood."""


class SiteViewer(Protocol):
    """A viewer of a site under fault."""

    @property
    def kind(self) -> str:
        """Its column in the table."""

    @property
    def reconnections(self) -> int:
        """How often its stream broke and was opened again."""

    async def run(self) -> None:
        """Watch until cancelled."""

    def has_begun(self) -> bool:
        """Return whether it has received video."""

    def gap(self, since: float, until: float) -> float:
        """Return the longest time without new video, beyond the usual; times of the monotonic clock."""


class ClientViewer:
    """`myview watch`: the Python client, which goes on at the other service where it knows one."""

    def __init__(self, url: str, number: int, views: StampedViews, *others: str) -> None:
        self.kind = "client"
        self._viewer, self._views = Viewer(url, number, others), views
        self._verdict: PictureVerdict | None = None

    @property
    def reconnections(self) -> int:
        """How often its stream broke and was opened again."""
        return self._viewer.reconnections

    async def run(self) -> None:
        """Watch until cancelled."""
        await self._viewer.run()

    def has_begun(self) -> bool:
        """Return whether it has received video."""
        return self._viewer.last_arrival > 0

    def check(self) -> PictureVerdict:
        """Check whether every picture is of its pulse; only once the viewer has ended."""
        if self._verdict is None:
            pictures = self._viewer.pictures()
            self._verdict = check_pictures(pictures, EventLog(), self._viewer.number, self._views)
        return self._verdict

    def gap(self, since: float, until: float) -> float:
        """Return the longest time without a fresh picture, beyond a GOP."""
        return max(0.0, self.check().longest_gap(since, until) - GOP_S)


class _HttpPlayer:
    """A player that knows one address only, that of the front, which leads it to a service by a cookie."""

    def __init__(self, front: str, number: int, service: int) -> None:
        self._stream, self._service = f"{front}objects/{number}/", service
        self.arrivals: list[float] = []
        self.reconnections = 0
        self.usual_s = GOP_S

    def has_begun(self) -> bool:
        """Return whether it has received video."""
        return bool(self.arrivals)

    def gap(self, since: float, until: float) -> float:
        """Return the longest time without new video, beyond a GOP or segment."""
        before = max((at for at in self.arrivals if at <= since), default=since)
        times = [before, *(at for at in self.arrivals if since < at <= until), until]
        return max(0.0, max(later - earlier for earlier, later in pairwise(times)) - self.usual_s)

    def _session(self) -> aiohttp.ClientSession:
        timeout = aiohttp.ClientTimeout(total=None, sock_connect=_READ_S, sock_read=_READ_S)
        # A cookie jar drops cookies of addresses without a name.
        headers = {"Cookie": f"myview_service={self._service}"}
        return aiohttp.ClientSession(timeout=timeout, headers=headers, raise_for_status=True)


class PlainPlayer(_HttpPlayer):
    """A player of the endless MP4 that opens it again when it breaks."""

    kind = "MP4"

    async def run(self) -> None:
        """Watch until cancelled."""
        async with self._session() as session:
            while True:
                with contextlib.suppress(*_FAILURES):
                    async with session.get(f"{self._stream}best.mp4") as answer:
                        await answer.content.readuntil(b"moof")  # behind the head, which comes at once
                        while await answer.content.readany():
                            self.arrivals.append(time.monotonic())
                self.reconnections += 1
                await asyncio.sleep(_RETRY_S)


class HlsPlayer(_HttpPlayer):
    """A player of HLS segments (RFC 8216), which asks for the playlist twice a segment."""

    kind = "HLS"

    async def run(self) -> None:
        """Watch until cancelled."""
        newest = ""
        async with self._session() as session:
            while True:
                try:
                    async with session.get(f"{self._stream}hls/index.m3u8") as answer:
                        duration, segment = _SEGMENT.findall(await answer.text())[-1]
                    self.usual_s = float(duration)
                    if segment != newest:
                        async with session.get(f"{self._stream}hls/{segment}") as answer:
                            await answer.read()
                        newest = segment
                        self.arrivals.append(time.monotonic())
                    await asyncio.sleep(self.usual_s / 2)
                except (*_FAILURES, IndexError):
                    self.reconnections += 1
                    await asyncio.sleep(_RETRY_S)


class PageViewer:
    """The page in a browser, which goes on at the other service."""

    kind = "page"
    reconnections = 0

    def __init__(self, browser: Browser, url: str, number: int) -> None:
        self._browser, self._url = browser, f"{url}?object={number}"
        self._shown: list[tuple[float, float]] = []
        """When the picture changed, by the monotonic clock, and for how long the one before it stood."""
        self._begun = False

    async def run(self) -> None:
        """Watch until cancelled."""
        # The page's policy forbids eval, which this measurement uses.
        page = await self._browser.new_page(bypass_csp=True)
        try:
            await self._watch(page)
        finally:
            await page.close()

    async def _watch(self, page: Page) -> None:
        await open_when_ready(page, self._url)
        await page.wait_for_function("myview.state === 'playing'", timeout=_PLAYING_MS)
        await page.evaluate(_RECORD_STALLS)
        self._begun = True
        while True:
            await asyncio.sleep(_RETRY_S)
            offset = time.time() - time.monotonic()
            found = await page.evaluate("window.stalls.splice(0)")
            self._shown += [(at - offset, stood) for at, stood in found]

    def has_begun(self) -> bool:
        """Return whether it plays."""
        return self._begun

    def gap(self, since: float, until: float) -> float:
        """Return the longest time that a picture stood."""
        changes = [(at, stood) for at, stood in self._shown if since < at <= until]
        last = max((at for at, _ in changes), default=since)
        return max([stood for _, stood in changes] + [until - last - _RETRY_S * 2, 0.0])
