"""`myview up` on replayed views, on free ports."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import AsyncIterator, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import aiohttp
import yaml

from benchmarks.common.environment import one_thread_environment
from benchmarks.common.report import Report
from server.cli.generated_config import free_port

CONFIG = "site.yaml"
LOG = "up.log"
_POLL_S = 0.2
_START_S = 150.0
_END_S = 15.0


class PlayedViews(Protocol):
    """The sections of a site's configuration that describe its views."""

    @property
    def cameras(self) -> list[dict[str, Any]]:
        """The section `cameras` of the configuration."""

    @property
    def site(self) -> dict[str, Any]:
        """The section `site` of the configuration."""

    @property
    def ground(self) -> Path | None:
        """The file of homographies to the ground plane."""


@dataclass(frozen=True, slots=True)
class RunningSite:
    """A running site."""

    url: str
    bus: str
    """The address of its zenoh router."""
    process: asyncio.subprocess.Process


@contextlib.asynccontextmanager
async def running_site(
    views: PlayedViews,
    folder: Path,
    environment: Mapping[str, str] | None = None,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
) -> AsyncIterator[RunningSite]:
    """Run `myview up` on the views, with its log in the folder.

    `environment` and `settings`, by section, are added.

    Raises:
        RuntimeError: it does not start; the log says why.
    """
    sync, bus, http = (free_port() for _ in range(3))
    address = f"tcp/127.0.0.1:{bus}"
    content: dict[str, Any] = {
        "site": views.site,
        "cameras": views.cameras,
        "sync": {"port": sync},
        "zenoh": {"connect": address, "listen": address},
        "http": {"port": http},
    }
    if views.ground is not None:
        content["ground"] = str(views.ground.absolute())
    for section, values in (settings or {}).items():
        content[section] = {**content.get(section, {}), **values}
    config = folder / CONFIG
    config.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    with (folder / LOG).open("w", encoding="utf-8") as log:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "server.cli.main", "up", str(config)),
            env={**one_thread_environment(), **(environment or {})},
            stdout=log,
            stderr=log,
        )
    site = RunningSite(f"http://127.0.0.1:{http}/", address, process)
    try:
        await _until_up(site)
        yield site
    finally:
        await _end(process)


@contextlib.contextmanager
def log_of_failure(folder: Path, report: Report) -> Iterator[None]:
    """Print the log of the site in a folder if what follows fails."""
    try:
        yield
    except Exception:
        if (log := folder / LOG).exists():
            report.line(log.read_text(encoding="utf-8"))
        raise


async def _until_up(site: RunningSite) -> None:
    """Wait until the best-view service answers, which is before the first pulse."""
    loop = asyncio.get_running_loop()
    give_up = loop.time() + _START_S
    async with aiohttp.ClientSession() as session:
        while loop.time() < give_up and site.process.returncode is None:
            with contextlib.suppress(aiohttp.ClientError):
                async with session.get(f"{site.url}healthz") as answer:
                    if answer.ok:
                        return
            await asyncio.sleep(_POLL_S)
    raise RuntimeError("`myview up` did not start")


async def _end(process: asyncio.subprocess.Process) -> None:
    if process.returncode is not None:
        return
    process.terminate()
    try:
        await asyncio.wait_for(process.wait(), _END_S)
    except TimeoutError:
        process.kill()
        await process.wait()
