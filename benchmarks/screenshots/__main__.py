"""Takes the README's screenshot of the page on the demo.

    python -m benchmarks.screenshots --out docs/screenshots

Lets the page play for a minute, then takes screenshots at several moments and keeps the best one. Those of
all states in three widths are taken by `benchmarks.screenshots.page_states`.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import io
import sys
from collections.abc import AsyncIterator
from pathlib import Path

from PIL import Image
from playwright.async_api import Page, ViewportSize

from benchmarks.common.browser import check_chromium, chromium
from benchmarks.common.environment import ROOT, CannotRunError, finish, one_thread_environment

_READY = "MyView is ready: "
_READY_S = 90.0
_PLAYING_MS = 60_000
_MOMENTS = 12
"""Screenshots of each size; the best is kept."""
_LANDED_S = 1.5
"""Milliseconds for the page to show another person, the list, and the boxes."""
_MOST_BYTES = 300_000
_COLORS = (256, 128, 64)
"""Palette sizes that are tried until a picture is small enough."""

_RATED = """async () => {
  const { objects } = await (await fetch('api/objects')).json();
  const seen = objects.filter((it) => it.visible && it.thumbnail);
  const rated = await Promise.all(seen.map(async ({ object, camera, cameras }) => {
    const { quality } = await (await fetch(`api/objects/${object}/choice`)).json();
    const together = seen.filter((it) => it.cameras.includes(camera)).length;
    const large = quality[camera] ?? 0;
    return { object, score: seen.length + together + cameras.length + 4 * large };
  }));
  return rated.sort((a, b) => b.score - a.score);
}"""
"""People in view, best first: large, in view of many cameras, and together with many others."""

_PLAYS = "myview.state === 'playing' && myview.camera !== null"


_SIZE: ViewportSize = {"width": 1280, "height": 800}


@contextlib.asynccontextmanager
async def demo() -> AsyncIterator[str]:
    """Run `myview demo`; yield its address once it is ready.

    Raises:
        RuntimeError: it does not become ready.
    """
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "server.cli.main", "demo", "--no-browser", "--port", "0"),
        env={**one_thread_environment(), "PYTHONUNBUFFERED": "1"},
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
    )
    try:
        yield await asyncio.wait_for(_address(process), _READY_S)
    except TimeoutError as error:
        raise RuntimeError(f"`myview demo` was not ready after {_READY_S:g} s") from error
    finally:
        if process.returncode is None:
            process.terminate()
        await process.wait()


async def _address(process: asyncio.subprocess.Process) -> str:
    assert process.stdout is not None  # noqa: S101 — it was asked for
    async for line in process.stdout:
        text = line.decode().strip()
        if text.startswith(_READY):
            return text.removeprefix(_READY).split()[0]
    raise RuntimeError("`myview demo` ended before it was ready")


async def take(fill_s: float) -> bytes:
    """Run the demo, open the page, let it play for so many seconds, and return a screenshot, PNG."""
    async with chromium() as browser, demo() as url:
        # The page's policy forbids eval, which Playwright needs.
        page = await browser.new_page(viewport=_SIZE, bypass_csp=True)
        await page.goto(url)
        await page.wait_for_function("myview.state === 'playing'", timeout=_PLAYING_MS)
        await asyncio.sleep(fill_s)
        return await _best_screenshot(page)


async def _best_screenshot(page: Page) -> bytes:
    """Take screenshots of the best visible person at several moments; return the best.

    Raises:
        RuntimeError: nobody is in view at any of them.
    """
    best, best_score = b"", 0.0
    for _ in range(_MOMENTS):
        rated = await page.evaluate(_RATED)
        if rated:
            await page.click(f"#people li[data-object='{rated[0]['object']}'] .person")
        await page.mouse.move(0, 0)  # so that nothing is highlighted below the pointer
        await page.evaluate("document.activeElement.blur(), scrollTo(0, 0)")
        await asyncio.sleep(_LANDED_S)
        score = await _score(page)
        screenshot = await page.screenshot()
        if score > best_score and await _score(page):
            best, best_score = screenshot, score
    if not best:
        raise RuntimeError("nobody was in view for long enough")
    return best


async def _score(page: Page) -> float:
    """Return a score of the page; 0 when the chosen person is not shown."""
    if not await page.evaluate(_PLAYS):
        return 0.0
    number = await page.evaluate("myview.object")
    return float(
        next((rating["score"] for rating in await page.evaluate(_RATED) if rating["object"] == number), 0.0)
    )


def small_png(png: bytes) -> bytes:
    """Return an image with as many colors as fit into the file size of a README's image."""
    image = Image.open(io.BytesIO(png)).convert("RGB")
    smaller = png
    for colors in _COLORS:
        if len(smaller) <= _MOST_BYTES:
            break
        target = io.BytesIO()
        # The median cut merges the white of the text with the walls; k-means separates it again.
        palette = image.quantize(colors, Image.Quantize.MEDIANCUT, kmeans=3)
        image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG).save(target, "PNG", optimize=True)
        smaller = target.getvalue()
    return smaller


def main() -> None:
    """Take the screenshot."""
    options = argparse.ArgumentParser(
        prog="python -m benchmarks.screenshots", description=__doc__.splitlines()[0]
    )
    options.add_argument(
        "--out", type=Path, default=ROOT / "docs" / "screenshots", help="folder to write into"
    )
    options.add_argument("--fill", type=float, default=62.0, help="seconds to let the page play before")
    chosen = options.parse_args()
    try:
        check_chromium()
        chosen.out.mkdir(parents=True, exist_ok=True)
        path = chosen.out / "page.png"
        path.write_bytes(small_png(asyncio.run(take(chosen.fill))))
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
    except CannotRunError as problem:
        finish(problem, "screenshots")


if __name__ == "__main__":
    main()
