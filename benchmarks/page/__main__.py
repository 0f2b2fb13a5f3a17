"""The page on the demo: time from a click to the new person's first frame, and memory over a visit.

    python -m benchmarks.page --out out/bench
    python -m benchmarks.page --part hours

A switch is a click on another person's card. It ends when the first frame of their best view has been shown,
by the browser's own clock. Memory is the JavaScript heap after a collection, and the player's buffered video.
``--part hours`` plays eight hours of a small site in a quarter of an hour.
"""

from __future__ import annotations

import argparse
import asyncio
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from playwright.async_api import CDPSession, Page

from benchmarks.common.browser import check_chromium, chromium
from benchmarks.common.demo_site import demo_at, open_when_ready
from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.page import long_playback as page_hours

_PLAYING_MS = 60_000
_SETTLE_S = 15.0
"""Milliseconds until some people are known."""
_BETWEEN_S = 0.5
_GOAL_MS = 500.0

_OTHERS = """async () => {
  const { objects } = await (await fetch('api/objects')).json();
  return objects.filter((it) => it.visible && it.object !== myview.object).map((it) => it.object);
}"""
_SHOWN = "myview.switches.at(-1)?.shownAt !== null"
"""Of the last choice: a person who is chosen again before being shown is shown once."""
_TRIES = 20
"""Tries for each switch: on a slow machine there may be nobody else in view."""
_BUFFERED = (
    "video.buffered.length ? video.buffered.end(video.buffered.length - 1) - video.buffered.start(0) : 0"
)


@dataclass(frozen=True, slots=True)
class PageVisit:
    """The measurements of a visit to the page.

    Attributes:
        switches: milliseconds from each click to the first frame of the new person.
        seconds: (readings,) time since the page was opened.
        heap: (readings,) megabytes.
        buffered: (readings,) seconds of video.
        delays: (readings,) milliseconds that the picture was behind the pulse.
    """

    switches: np.ndarray
    seconds: np.ndarray
    heap: np.ndarray
    buffered: np.ndarray
    delays: np.ndarray


async def visit(url: str, switches: int, minutes: float) -> PageVisit:
    """Open the page, switch from person to person, then watch."""
    async with chromium() as browser:
        # The page's policy forbids eval, which Playwright needs.
        page = await browser.new_page(viewport={"width": 1280, "height": 800}, bypass_csp=True)
        await open_when_ready(page, url)
        await page.wait_for_function("myview.state === 'playing'", timeout=_PLAYING_MS)
        await asyncio.sleep(_SETTLE_S)
        tools = await page.context.new_cdp_session(page)
        readings = [await _reading(page, tools)]
        took: list[float] = []
        for turn in range(_TRIES * switches):
            took += await _switch(page, turn)
            if len(took) >= switches:
                break
            await asyncio.sleep(_BETWEEN_S)
        else:
            raise CannotRunError(
                f"in {_TRIES * switches} tries there were {len(took)} people to switch to: take fewer --fps"
            )
        readings.append(await _reading(page, tools))
        for _ in range(round(4 * minutes)):
            await asyncio.sleep(15.0)
            readings.append(await _reading(page, tools))
        return PageVisit(np.array(took), *np.array(readings).T)


async def _switch(page: Page, turn: int) -> list[float]:
    """Click on another person's card; return the time to their first frame, empty without other people."""
    others = await page.evaluate(_OTHERS)
    if not others:
        return []
    number = others[turn % len(others)]
    card = page.locator(f"#people li[data-object='{number}'] .person")
    if not await card.count():
        return []
    await card.click()
    await page.wait_for_function(_SHOWN, timeout=_PLAYING_MS)
    last = await page.evaluate("myview.switches.at(-1)")
    return [last["shownAt"] - last["chosenAt"]] if last["object"] == number else []


async def _reading(page: Page, tools: CDPSession) -> tuple[float, float, float, float]:
    await tools.send("HeapProfiler.collectGarbage")
    heap = (await tools.send("Runtime.getHeapUsage"))["usedSize"] / 1e6
    delays = [delay["delayMs"] for delay in await page.evaluate("myview.delays.slice(-100)")]
    return (
        await page.evaluate("performance.now()") / 1e3,
        heap,
        float(await page.evaluate(_BUFFERED)),
        float(np.median([delay for delay in delays if delay is not None] or [np.nan])),
    )


def describe(report: Report, visit: PageVisit) -> None:
    """Print the tables."""
    middle, late = np.percentile(visit.switches, [50, 95])
    report.table(
        "from a click to the new person's first frame, ms",
        ["switches", "p50", "p95", "longest", "goal, p95"],
        [
            [
                str(len(visit.switches)),
                f"{middle:.0f}",
                f"{late:.0f}",
                f"{visit.switches.max():.0f}",
                f"{_GOAL_MS:.0f}",
            ]
        ],
    )
    report.table(
        "the browser",
        ["minute", "heap, MB", "buffered, s", "behind, ms"],
        [
            [f"{second / 60:.1f}", f"{heap:.1f}", f"{buffered:.0f}", f"{delay:.0f}"]
            for second, heap, buffered, delay in zip(
                visit.seconds, visit.heap, visit.buffered, visit.delays, strict=True
            )
        ],
    )


def plot(visit: PageVisit, path: Path) -> None:
    """Draw the switch times, and memory and delay over the visit."""
    figure = Figure(figsize=(9, 6))
    took, memory = figure.subplots(2, 1)
    took.plot(
        np.sort(visit.switches),
        np.arange(1, len(visit.switches) + 1) / len(visit.switches),
        drawstyle="steps-post",
    )
    took.axvline(_GOAL_MS, color="black", linestyle="--", linewidth=1, label="goal for 95 %")
    took.set(xlabel="ms from the click to the first frame", ylabel="share of the switches", xlim=(0, None))
    took.legend()
    memory.plot(visit.seconds / 60, visit.heap, label="heap, MB")
    memory.plot(visit.seconds / 60, visit.buffered, label="buffered, s")
    memory.plot(visit.seconds / 60, visit.delays / 1e3, label="behind, s")
    memory.set(xlabel="minutes", ylim=(0, None))
    memory.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)


async def run(options: argparse.Namespace) -> PageVisit:
    """Run the demo, and measure a visit."""
    async with demo_at(options.fps) as url:
        return await visit(url, options.switches, options.minutes)


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "page")
    options.add_argument("--part", choices=("visit", "hours"), default="visit")
    options.add_argument("--hours", type=float, default=8.0, help="that are played, of --part hours")
    options.add_argument("--speed", type=float, default=16.0, help="how many times as fast")
    options.add_argument(
        "--fps", type=float, default=25.0, help="of the demo; less where there is other work"
    )
    options.add_argument("--switches", type=int, default=50)
    options.add_argument("--minutes", type=float, default=2.0, help="of watching after them")
    try:
        check_chromium()
        chosen = options.parse_args()
        report = Report()
        if chosen.part == "hours":
            page_hours.run(report, chosen.hours, chosen.speed)
            report.save(chosen.out / "page_hours.txt")
            return
        visit = asyncio.run(run(chosen))
        describe(report, visit)
        chosen.out.mkdir(parents=True, exist_ok=True)
        plot(visit, chosen.out / "page.png")
        report.save(chosen.out / "page.txt")
    except CannotRunError as problem:
        finish(problem, "page")


if __name__ == "__main__":
    main()
