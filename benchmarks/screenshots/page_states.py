"""Takes the documents' screenshots of both pages in each of their states, on the demo, in three widths.

    python -m benchmarks.screenshots.page_states --out docs/screenshots

The states are real: a person leaves, a camera process is stopped, the server is terminated. Only the state
without any people is faked by this script: on the demo it is over within a moment.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from playwright.async_api import Browser, Page
from playwright.async_api import TimeoutError as LateError

from benchmarks.common.browser import check_chromium, chromium
from benchmarks.common.demo_site import demo_at, open_when_ready
from benchmarks.common.environment import CannotRunError, finish
from benchmarks.common.process_load import running_pids
from benchmarks.screenshots.webp_files import WIDTHS, options_of, write_webp

_PATIENCE_MS = 6_000
_TRIES = 12
_LONG_MS = 120_000
_LANDED_MS = 1_500
"""Milliseconds for another person to be shown, and the list to follow."""
_SETTLED_S = 1.2
"""Milliseconds after a resize until the picture and the boxes are back."""
_MINUTE_S = 60.0

_NOBODY = """const listen = EventSource.prototype.addEventListener;
EventSource.prototype.addEventListener = function (name, heard) {
  const told = () => heard(new MessageEvent(name, { data: '{"objects": []}' }));
  listen.call(this, name, name === 'objects' ? told : heard);
};"""
_SEEN_BY_MANY = """async () => {
  const { objects } = await (await fetch('api/objects')).json();
  const seen = objects.filter((it) => it.visible && it.thumbnail);
  seen.sort((a, b) => b.cameras.length - a.cameras.length || a.object - b.object);
  return seen.map((it) => it.object);
}"""
_LEFT = """async () => {
  const { objects } = await (await fetch('api/objects')).json();
  return objects.filter((it) => !it.visible && it.thumbnail).map((it) => it.object);
}"""
_SECTIONS = {
    "cameras": "",
    "site": "#site-cameras",
    "floor": "",
    "people": "",
    "zones": "",
    "ignored-areas": "",
    "calibration": "",
    "calibration-points": "",
    "view-selection": "",
}
"""Sections of the operator's page, and what is at the top of the screen, if not the section's beginning."""
_MEASURED_MS = 8_000
"""Milliseconds until a section has its pictures and measurements."""
_PLAYS = "myview.state === 'playing' && myview.camera !== null"
_TABLE = "document.querySelector('#why table')"
_AWAY = "document.querySelector('#cameras .away')"


Prepare = Callable[[], Awaitable[None]]


@dataclass(frozen=True, slots=True)
class ScreenshotSession:
    """An open page, and the folder for its screenshots."""

    page: Page
    out: Path

    async def shoot(self, state: str, prepare: Prepare, until: str = _PLAYS, top: str = "body") -> None:
        """Take screenshots of a state in all widths, each when a JavaScript expression holds.

        The screen begins at the element ``top``, a selector. People come and go meanwhile: a state that is
        not reached is prepared again.

        Raises:
            RuntimeError: the state is not reached in time.
        """
        for width, height in WIDTHS.items():
            await self.page.set_viewport_size({"width": width, "height": height})
            for _ in range(_TRIES):
                await prepare()
                await self.page.mouse.move(0, 0)  # so that nothing is highlighted below the pointer
                await self.page.evaluate("document.activeElement.blur()")
                await self.page.evaluate(f"document.querySelector('{top}').scrollIntoView()")
                await asyncio.sleep(_SETTLED_S)
                with contextlib.suppress(LateError):
                    await self.page.wait_for_function(until, timeout=_PATIENCE_MS)
                    break
            else:
                raise RuntimeError(f"{state}: not reached")
            png = await self.page.screenshot()
            await asyncio.to_thread(write_webp, png, self.out / str(width) / f"{state}.webp")

    async def as_it_is(self) -> None:
        """Prepare nothing."""

    async def choose(self, script: str, keys: str = "") -> None:
        """Choose the first person that a script returns, as soon as there is one, and press keys."""
        number = (await self._found(script))[0]
        await self.page.evaluate(f"document.querySelector(`li[data-object='{number}'] .person`)?.click()")
        await self.page.wait_for_timeout(_LANDED_MS)
        for key in keys:
            await self.page.keyboard.press(key)

    async def beside(self) -> None:
        """Choose a person, and two more beside them."""
        await self.choose(_SEEN_BY_MANY)
        for number in (await self._found(_SEEN_BY_MANY))[1:3]:
            plus = f"li[data-object='{number}'] .plus[aria-pressed=false]"
            await self.page.evaluate(f"document.querySelector(`{plus}`)?.click()")

    async def _found(self, script: str) -> list[int]:
        for _ in range(_LONG_MS // _LANDED_MS):
            if found := await self.page.evaluate(script):
                return list(found)
            await self.page.wait_for_timeout(_LANDED_MS)
        raise RuntimeError("no person was in view, or had left, for long enough")


async def take_operating(out: Path, fps: float) -> None:
    """Run the demo, and take screenshots of the operator's page."""
    async with chromium() as browser, demo_at(fps) as url:
        async with _sitting(browser, url, out) as sitting:
            await sitting.page.wait_for_function(_PLAYS, timeout=_LONG_MS)
        for state, top in _SECTIONS.items():
            section = "cameras" if top else state
            async with _sitting(browser, f"{url}operator#{section}", out) as sitting:
                await sitting.page.wait_for_timeout(_MEASURED_MS)
                there = f"document.querySelector('#{section}').hidden === false"
                await sitting.shoot(f"operator-{state}", sitting.as_it_is, there, top or "body")


async def take_watching(out: Path, fps: float) -> None:
    """Run the demo, and take screenshots of the viewer's page."""
    async with chromium() as browser, contextlib.AsyncExitStack() as stack:
        url = await stack.enter_async_context(demo_at(fps))
        async with _sitting(browser, url, out, _NOBODY) as sitting:
            await sitting.shoot("nobody", sitting.as_it_is, "myview.state === 'empty'")
        async with _sitting(browser, url, out) as sitting:
            await sitting.page.wait_for_function(_PLAYS, timeout=_LONG_MS)
            await asyncio.sleep(_MINUTE_S)
            await _watched(sitting)
            await _gone(sitting)
            await stack.aclose()
            await sitting.shoot("server-lost", sitting.as_it_is, "myview.state === 'lost'")


@contextlib.asynccontextmanager
async def _sitting(
    browser: Browser, url: str, out: Path, script: str = ""
) -> AsyncIterator[ScreenshotSession]:
    # The page's policy forbids eval, which Playwright needs.
    page = await browser.new_page(bypass_csp=True)
    if script:
        await page.add_init_script(script)
    await open_when_ready(page, url)
    yield ScreenshotSession(page, out)
    await page.close()


async def _watched(sitting: ScreenshotSession) -> None:
    choose, page = sitting.choose, sitting.page
    await sitting.shoot("watching", partial(choose, _SEEN_BY_MANY))
    await page.keyboard.press("w")
    await sitting.shoot("why", partial(choose, _SEEN_BY_MANY), f"{_PLAYS} && {_TABLE}")
    await page.keyboard.press("w")
    await page.keyboard.press("z")
    await sitting.shoot("follow", partial(choose, _SEEN_BY_MANY))
    await page.keyboard.press("z")
    await sitting.shoot("held", partial(choose, _SEEN_BY_MANY, "02"), f"{_PLAYS} && myview.camera === 'c1'")
    await sitting.shoot("preferred", partial(choose, _SEEN_BY_MANY, "02p"))
    await page.keyboard.press("0")
    await sitting.shoot("tiles", sitting.beside)
    await page.evaluate("document.querySelectorAll('.plus[aria-pressed=true]').forEach((it) => it.click())")


async def _gone(sitting: ScreenshotSession) -> None:
    """Take screenshots of a paused page, of a person who has left, and of a stopped camera."""
    page = sitting.page

    async def stopped() -> None:
        await page.keyboard.press("End")
        await sitting.choose(_SEEN_BY_MANY, ",")
        await page.wait_for_timeout(_LANDED_MS)
        await page.evaluate("video.pause()")

    await sitting.shoot("paused", stopped, "myview.state === 'paused' && myview.delays.at(-1).delayMs > 4000")
    await page.keyboard.press("End")
    await sitting.shoot("left", partial(sitting.choose, _LEFT), "myview.state === 'away'")
    camera = running_pids("camera c0")
    for pid in camera:
        os.kill(pid, signal.SIGSTOP)
    await sitting.shoot("camera-lost", partial(sitting.choose, _SEEN_BY_MANY), f"{_PLAYS} && {_AWAY}")
    for pid in camera:
        os.kill(pid, signal.SIGKILL)


def main() -> None:
    """Take the screenshots."""
    options = options_of("page_states", __doc__)
    options.add_argument("--fps", type=float, default=25.0, help="frame rate; less on a machine that is busy")
    options.add_argument("--page", choices=("viewer", "operator"), help="only this one's")
    chosen = options.parse_args()
    try:
        check_chromium()

        if chosen.page != "operator":
            asyncio.run(take_watching(chosen.out, chosen.fps))
        if chosen.page != "viewer":
            asyncio.run(take_operating(chosen.out, chosen.fps))
        made = sorted(chosen.out.glob("*/*.webp"))
        print(f"{len(made)} screenshots, {sum(path.stat().st_size for path in made) / 1000:.0f} kB")
    except CannotRunError as problem:
        finish(problem, "screenshots.page_states")


if __name__ == "__main__":
    main()
