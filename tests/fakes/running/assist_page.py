"""The page of a running site with operator assistance."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from playwright.async_api import Page

from benchmarks.common.browser import chromium
from fakes.page.browser import new_page
from fakes.running.site import PATIENT_CAMERAS, RunningSite, running
from fakes.running.stream_frames import FPS
from server.cli.generated_config import DEMO, free_port

GOP = 10
PERSON_POSITION_JS = """(number) => {
  const box = myview.boxes.find(([object]) => object === (number ?? myview.pointing.object));
  if (!box) return null;
  const { left, top, width } = document.querySelector('#boxes').getBoundingClientRect();
  const scale = width / myview.site.width;
  return [left + scale * (box[1] + box[3]) / 2, top + scale * (box[2] + box[4]) / 2];
}"""
"""Return a person's position on the screen; without an id, that of the person pointed at."""


@contextlib.asynccontextmanager
async def assisted_site(
    folder: Path, cameras: Sequence[Mapping[str, Any]], **assist: Any
) -> AsyncIterator[RunningSite]:
    """Run a site with operator assistance at a low frame rate; every crossing raises a flag."""
    bus = f"tcp/127.0.0.1:{free_port()}"
    content = {
        **DEMO,
        "cameras": list(cameras),
        "site": {"name": "demo", "fps": FPS, "width": 320, "height": 180, "niceness": 1},
        "encode": {"gop_s": GOP / FPS},
        "sync": {"port": free_port(), "start_timeout_s": 60},
        "zenoh": {"connect": bus, "listen": bus},
        "http": {"port": free_port()},
        "track": {
            "assist": {"enabled": True, "crossing_margin": 1000.0, "swap_margin": 100.0, **assist},
            **PATIENT_CAMERAS,
        },
        "view": {"late_after_s": 60, "flags": {"per_minute": 60, "risk": 0.0, "answer_s": 600}},
    }
    path = folder / "demo.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    async with running(path) as site:
        await site.until(lambda: bool(site.gops and site.gops[-1].choices), "a person is shown")
        yield site


@contextlib.asynccontextmanager
async def open_page(site: RunningSite) -> AsyncIterator[Page]:
    """Open the page; an error in it fails the test."""
    errors: list[str] = []
    async with chromium() as browser:
        page = await new_page(browser, bypass_csp=True)
        page.on("pageerror", lambda error: errors.append(str(error)))
        await page.goto(site.url)
        yield page
    assert errors == []


def check_every_gop_once(site: RunningSite) -> None:
    """Check that each GOP was published exactly once, apart from those that a busy machine skipped."""
    firsts = [gop.first for gop in site.gops]
    if any("skipping to the present" in line for line in site.lines):
        assert firsts == sorted(set(firsts)), firsts
    else:
        assert firsts == list(range(firsts[0], firsts[0] + GOP * len(firsts), GOP)), "\n".join(site.lines)
