"""Takes the documents' screenshots of the set-up page, in three widths: three cameras found, tried and added.

    python -m benchmarks.screenshots.setup_states --out docs/screenshots

The page and its server are real; the cameras are drawn, so that no network is needed.
"""

from __future__ import annotations

import asyncio
import contextlib
import tempfile
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from playwright.async_api import Page

from benchmarks.common.browser import check_chromium, chromium
from benchmarks.common.environment import CannotRunError, finish
from benchmarks.screenshots.webp_files import WIDTHS, options_of, write_webp
from server.http.setup_app import serve_setup
from server.setup.camera_address import CameraAddress, free_name, parse_address
from server.setup.discovery import FoundCamera
from server.setup.session import SetupSession, TriedCamera, TriedStream
from server.setup.trial_messages import ProfileList, StreamProfile, StreamTrial
from synthetic import Scene

_NAMES = ("door", "hall", "stairs")
_SIZE = (640, 360)
_START = 200
"""The scene's frame: people are in view."""


class DrawnSession(SetupSession):
    """A set-up whose cameras are views of the synthetic room."""

    async def discover(self, seconds: float = 0.0) -> Sequence[FoundCamera]:
        """Find the cameras."""
        del seconds
        self.found = [
            FoundCamera(name, f"10.0.0.{place}", 80, name=name, hardware="X1")
            for place, name in enumerate(_NAMES, 11)
        ]
        return self.found

    async def profiles(
        self, host: str, port: int, user: str, password: str
    ) -> tuple[ProfileList, Sequence[int]]:
        """Offer a main and a sub stream."""
        del port
        number = int(host.rpartition(".")[2])
        profiles = [
            StreamProfile("main", f"rtsp://{host}/main", "H264", 1920, 1080, 25),
            StreamProfile("sub", f"rtsp://{host}/sub", "H264", 640, 360, 25),
        ]
        for key, profile in zip((number, 100 + number), profiles, strict=True):
            self._streams[key] = parse_address(profile.address, user, password)
        return ProfileList(profiles=profiles), (number, 100 + number)

    async def _try(
        self, address: CameraAddress, name: str, substream: CameraAddress | None = None
    ) -> TriedCamera:
        number = len(self.cameras)
        picture = Scene("room", len(_NAMES), 4, 1, *_SIZE).image(number, _START)
        jpeg = np.asarray(cv2.imencode(".jpg", picture)[1]).tobytes()
        trial = StreamTrial(width=1920, height=1080, fps=25, codec="h264", picture=jpeg)
        small = None
        if substream is not None:
            small = TriedStream(substream, StreamTrial(width=640, height=360, fps=25, codec="h264"))
        camera = TriedCamera(number, free_name(name, set()), TriedStream(address, trial), small)
        self.cameras.append(camera)
        return camera


async def take(out: Path) -> None:
    """Serve the set-up page, add the cameras, and take the screenshots."""
    printed: asyncio.Queue[str] = asyncio.Queue()
    with tempfile.TemporaryDirectory() as folder:
        session = DrawnSession(Path(folder) / "site.yaml")
        serving = asyncio.create_task(serve_setup(session, 0, printed.put_nowait))
        try:
            async with chromium() as browser:
                # The page's policy forbids eval, which Playwright needs.
                page = await browser.new_page(bypass_csp=True)
                await page.goto(await printed.get())
                await _add_cameras(page)
                await page.evaluate("document.querySelector('#file').hidden = true")  # a temporary folder
                for width, height in WIDTHS.items():
                    await page.set_viewport_size({"width": width, "height": height})
                    await page.evaluate("document.activeElement.blur(), scrollTo(0, 0)")
                    await asyncio.to_thread(
                        write_webp, await page.screenshot(full_page=True), out / str(width) / "setup.webp"
                    )
        finally:
            serving.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await serving


async def _add_cameras(page: Page) -> None:
    await page.fill("#camera-user", "viewer")
    await page.fill("#camera-password", "password")
    for place, _ in enumerate(_NAMES, 1):
        item = page.locator(f"#found li:nth-child({place})")
        await item.get_by_role("button").first.click()
        await item.get_by_role("button", name="Try main").click()
        await page.wait_for_function(f"document.querySelectorAll('#added img').length === {place}")
    await page.wait_for_function(
        "[...document.querySelectorAll('#added img')].every((picture) => picture.naturalWidth > 0)"
    )


def main() -> None:
    """Take the screenshots."""
    options = options_of("setup_states", __doc__)
    out = options.parse_args().out
    try:
        check_chromium()
        asyncio.run(take(out))
        print(*(f"{out / str(width) / 'setup.webp'}" for width in WIDTHS), sep="\n")
    except CannotRunError as problem:
        finish(problem, "screenshots.setup_states")


if __name__ == "__main__":
    main()
