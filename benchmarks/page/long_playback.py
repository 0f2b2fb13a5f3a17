"""Hours of playback in minutes: growth of the page's memory and delay.

The page's clock, its timers and the site are accelerated alike. A browser plays at sixteen times the speed at
most: beyond that the page skips ahead, as on a slow machine. All media pass the download, the SourceBuffer,
the decisions, the timeline and the list of people.
"""

from __future__ import annotations

import asyncio
import os
import time
from dataclasses import dataclass

import numpy as np
from playwright.async_api import CDPSession, Page

from benchmarks.common.browser import chromium
from benchmarks.common.report import Report
from benchmarks.page.fast_site import FastClock, serving

_READINGS = 16
_PLAYING_MS = 60_000
_MOST_RATE = 16
_FASTER = """(() => {
  const speed = %(speed)s, begun = %(begun)s;
  const [now, steady, later, again] = [Date.now, performance.now.bind(performance), setTimeout, setInterval];
  Date.now = () => begun + (now() - begun) * speed;
  performance.now = () => steady() * speed;
  window.setTimeout = (work, wait, ...rest) => later(work, (wait ?? 0) / speed, ...rest);
  window.setInterval = (work, wait, ...rest) => again(work, (wait ?? 0) / speed, ...rest);
  AbortSignal.timeout = (wait) => {
    const control = new AbortController();
    setTimeout(() => control.abort(), wait);
    return control.signal;
  };
  const frames = HTMLVideoElement.prototype.requestVideoFrameCallback;
  HTMLVideoElement.prototype.requestVideoFrameCallback = function (tell) {
    const told = (at, frame) => tell(at * speed, {
      mediaTime: frame.mediaTime, expectedDisplayTime: frame.expectedDisplayTime * speed });
    return frames.call(this, told);
  };
  const rate = Object.getOwnPropertyDescriptor(HTMLMediaElement.prototype, 'playbackRate');
  Object.defineProperty(HTMLMediaElement.prototype, 'playbackRate', {
    get() { return this.wished ?? 1; },
    set(wished) { this.wished = wished; rate.set.call(this, Math.min(wished * speed, %(most)s)); },
  });
  document.addEventListener('playing', ({ target }) => { target.playbackRate = target.wished ?? 1; }, true);
})();"""
_STATE = """() => ({
  delays: myview.delays.slice(-200).map((it) => it.delayMs),
  stood: (Date.now() - myview.delays.at(-1).shownAt) / 1000,
  ranges: video.buffered.length,
  buffered: video.buffered.end(video.buffered.length - 1) - video.buffered.start(0),
})"""
# The newest person stays for an hour, so the picture continues until the next reading.
_NEWEST = "document.querySelector('#people li:last-child button').click()"
_WATCHED = """() => { window.shown = 0;
  const count = () => { shown += 1; video.requestVideoFrameCallback(count); };
  video.requestVideoFrameCallback(count); }"""


@dataclass(frozen=True, slots=True)
class BrowserSample:
    """The browser at one moment.

    Attributes:
        hours: of the site's time.
        heap: JavaScript heap after a collection, megabytes.
        nodes: DOM nodes.
        listeners: event listeners.
        ranges: buffered ranges of the SourceBuffer.
        buffered: seconds of video from the first range to the last.
        behind: median delay of the last shown frames, milliseconds of the site's time.
        stood: seconds of the site's time since the last frame was shown.
        shown: frames since the beginning.
        load: load average of the machine.
    """

    hours: float
    heap: float
    nodes: int
    listeners: int
    ranges: int
    buffered: float
    behind: float
    stood: float
    shown: int
    load: float


async def play(hours: float, speed: float) -> list[BrowserSample]:
    """Play for hours; switch to the newest person now and then, as a viewer does."""
    clock = FastClock(speed, time.time())
    async with serving(clock) as url, chromium() as browser:
        page = await browser.new_page(viewport={"width": 1280, "height": 800})
        await page.add_init_script(
            _FASTER % {"speed": speed, "begun": 1000 * clock.begun, "most": _MOST_RATE}
        )
        await page.goto(url)
        await page.wait_for_function("myview.state === 'playing'", timeout=_PLAYING_MS)
        await page.evaluate(_WATCHED)
        await page.evaluate(_NEWEST)
        tools = await page.context.new_cdp_session(page)
        await tools.send("Performance.enable")
        begun, readings = clock.now(), []
        for number in range(1, _READINGS + 1):
            await clock.until(begun + 3600 * hours * number / _READINGS)
            await page.evaluate(
                _NEWEST
            )  # known for another hour, so the picture continues until the next reading
            await page.keyboard.press("w")
            readings.append(await _read(page, tools, (clock.now() - begun) / 3600))
    return readings


async def _read(page: Page, tools: CDPSession, hours: float) -> BrowserSample:
    await tools.send("HeapProfiler.collectGarbage")
    heap = (await tools.send("Runtime.getHeapUsage"))["usedSize"] / 1e6
    metrics = {
        metric["name"]: metric["value"] for metric in (await tools.send("Performance.getMetrics"))["metrics"]
    }
    state = await page.evaluate(_STATE)
    behind = [delay for delay in state["delays"] if delay is not None]
    return BrowserSample(
        hours,
        heap,
        int(metrics["Nodes"]),
        int(metrics["JSEventListeners"]),
        state["ranges"],
        state["buffered"],
        float(np.median(behind or [np.nan])),
        state["stood"],
        await page.evaluate("shown"),
        os.getloadavg()[0],
    )


def describe(report: Report, readings: list[BrowserSample], speed: float) -> None:
    """Print the table, and the growth from the first half to the second."""
    report.table(
        f"the page over hours, {speed:g} times as fast",
        [
            "hour",
            "heap, MB",
            "nodes",
            "listeners",
            "ranges",
            "buffered, s",
            "behind, s",
            "stood, s",
            "frames",
            "load",
        ],
        [
            [
                *(
                    f"{reading.hours:.2f}",
                    f"{reading.heap:.2f}",
                    str(reading.nodes),
                    str(reading.listeners),
                    str(reading.ranges),
                ),
                *(f"{reading.buffered:.0f}", f"{reading.behind / 1000:.1f}", f"{reading.stood:.1f}"),
                *(str(reading.shown), f"{reading.load:.0f}"),
            ]
            for reading in readings
        ],
    )
    half = len(readings) // 2
    early, late = (
        np.median(
            [(reading.heap, reading.nodes, reading.buffered, reading.behind / 1000) for reading in some],
            axis=0,
        )
        for some in (readings[1:half], readings[half:])
    )
    report.table(
        "medians of both halves",
        ["", "heap, MB", "nodes", "buffered, s", "behind, s"],
        [[name, *(f"{value:.2f}" for value in row)] for name, row in (("first", early), ("second", late))],
    )


def run(report: Report, hours: float, speed: float) -> None:
    """Run this part."""
    describe(report, asyncio.run(play(hours, speed)), speed)
