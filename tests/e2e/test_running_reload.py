"""Reload of a running site's configuration while a viewer watches."""

from __future__ import annotations

import asyncio
import os
import signal
from itertools import pairwise
from pathlib import Path
from typing import Any

import aiohttp
import pytest
import yaml

from fakes.running.site import RunningSite, configuration, running, with_timeout
from fakes.running.stream_frames import pictures, record

pytestmark = [pytest.mark.live, pytest.mark.slow]


async def wait_for_log(site: RunningSite, text: str) -> None:
    """Wait until a line of the log contains a text."""

    async def look() -> None:
        while not any(text in line for line in site.lines):  # noqa: ASYNC110 — another process: there is no event
            await asyncio.sleep(0.05)

    await with_timeout(look())


async def reload(running_site: RunningSite, config: Path, **changes: Any) -> None:
    """Change the configuration file and reload it."""
    config.write_text(yaml.safe_dump({**running_site.config, **changes}), encoding="utf-8")
    running_site.process.send_signal(signal.SIGHUP)


async def test_an_invalid_file_changes_nothing_and_a_valid_one_interrupts_no_stream(
    recording: Path, tmp_path: Path
) -> None:
    config = configuration(tmp_path, recording, camera={"at_end": "loop"})
    async with running(config) as site, aiohttp.ClientSession(site.url) as session:

        async def ask(path: str) -> Any:
            async with session.get(path) as answer:
                return await (answer.json() if path.startswith("api") else answer.text())

        await site.until(lambda: bool(site.gops and site.gops[-1].choices), "a person is shown")
        processes = site.children()
        path = f"objects/{min(site.gops[-1].choices)}/best.mp4"
        end = site.pulse + 100
        viewer = asyncio.create_task(record(session, path, lambda pulse: pulse >= end, tmp_path / "viewer"))

        await reload(site, config, site={"fps": "banana"})
        await wait_for_log(site, "site.fps: Input should be a valid number")
        assert "myview_config_differs 1.0" in await ask("metrics")
        os.kill(processes["c2"], signal.SIGKILL)  # it is restarted with the configuration in force
        await site.until(lambda: site.state("c2") != "live", "c2 is lost")
        await site.until(lambda: site.state("c2") == "live", "c2 is back")

        cameras = [dict(camera) for camera in site.config["cameras"]]
        cameras[1]["offset_s"] = 0.2
        view = {**site.config["view"], "switch_cost_s": 0.7}
        await reload(site, config, cameras=cameras, view=view, encode={"crf": 30})
        await wait_for_log(site, "bestview: configuration reloaded: in force now: view.switch_cost_s")
        await wait_for_log(site, "c1: configuration reloaded: this camera restarts")
        assert (await ask("api/operator/view_selection"))["values"]["switch_cost_s"] == 0.7
        assert (await ask("api/operator/config"))["changed_keys"] == ["encode.crf"]
        await with_timeout(viewer)
        await wait_for_log(site, "waits for a restart of all processes: encode.crf")
        now = site.children()
        assert {process: now[process] for process in processes if process != "c2"} == {
            process: pid for process, pid in processes.items() if process != "c2"
        }
        await site.until(lambda: site.state("c1") == "live", "c1 has restarted")
        site.process.send_signal(signal.SIGTERM)
        assert await site.wait_for_exit() == 0
    shown = sorted(pictures(tmp_path / "viewer"))
    assert len(shown) > 80
    assert all(after == before + 1 for before, after in pairwise(shown)), "the stream has no gap"
