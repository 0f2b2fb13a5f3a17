"""``myview demo``: a site on the embedded synthetic scene."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import tempfile
import webbrowser
from pathlib import Path

import aiohttp
import typer

from server.cli.generated_config import demo_config, free_port
from server.config.site_config import Config
from server.supervisor.startup_checks import check_port_free
from server.supervisor.supervisor import Supervisor
from server.system.processors import available_processors

log = logging.getLogger(__name__)

_PORT = 8080
_RATES = {4: 25.0, 2: 12.5, 0: 6.25}
"""Frames a second by the least number of processors: rendering and detecting people, and a browser without a
graphics card, need more than two at 25."""
_POLL_S = 0.2
_FIRST_BYTES = 4096
"""More than the head of a stream: after so many bytes the first picture has arrived."""


def demo_fps(processors: float) -> float:
    """Return the frame rate that this number of processors can sustain."""
    return next(rate for least, rate in _RATES.items() if processors >= least)


async def run_demo(
    port: int | None, seconds: float | None, *, open_browser: bool, fps: float | None = None
) -> None:
    """Run the demo until it is cancelled, or for ``seconds``; ``fps`` overrides the machine's rate.

    Raises:
        UserError: the requested port is in use.
    """
    if port is not None:
        check_port_free("127.0.0.1", port, "--port")
    http_port = port or free_port(_PORT if port is None else 0)
    processors = available_processors()
    with tempfile.TemporaryDirectory(prefix="myview-demo-") as folder:
        path, config = demo_config(Path(folder), http_port, fps or demo_fps(processors))
        typer.echo(_rate_line(config.site.fps, processors))
        supervisor = asyncio.create_task(_run(path, config))
        announcement = asyncio.create_task(
            _announce(f"http://127.0.0.1:{http_port}/", open_browser=open_browser)
        )
        try:
            await asyncio.wait({supervisor}, timeout=seconds)
            if supervisor.done():
                await supervisor
        finally:
            for task in (announcement, supervisor):
                task.cancel()
            await asyncio.gather(announcement, supervisor, return_exceptions=True)


async def _run(path: Path, config: Config) -> None:
    """Run the site, again when an operator restarts it."""
    while True:
        supervisor = Supervisor(path, config, {}, None)
        await supervisor.run()
        if not supervisor.restart_wanted:
            return


def _rate_line(fps: float, processors: float) -> str:
    line = f"Three cameras at {fps:g} frames a second"
    if fps != demo_fps(processors):
        return line
    count = f"{processors:.3g} processor{'s' if processors > 1 else ''}"
    return f"{line}, which {count} can do (MYVIEW_SITE__FPS sets another rate)"


async def _announce(url: str, *, open_browser: bool) -> None:
    """Print the address of the page as soon as the first stream begins, and open a browser."""
    async with aiohttp.ClientSession() as session:
        while not await _first_picture(session, url):  # noqa: ASYNC110 — another process, so there is no event
            await asyncio.sleep(_POLL_S)
    typer.echo(f"MyView is ready: {url}   (Ctrl-C stops it)")
    if open_browser:
        await asyncio.to_thread(webbrowser.open, url)


async def _first_picture(session: aiohttp.ClientSession, url: str) -> bool:
    with contextlib.suppress(aiohttp.ClientError, TimeoutError, EOFError):
        async with session.get(f"{url}api/objects") as answer:
            objects = (await answer.json())["objects"]
        if objects:
            number = objects[0]["object"]
            async with session.get(f"{url}objects/{number}/best.mp4") as stream:
                return bool(await stream.content.readexactly(_FIRST_BYTES))
    return False
