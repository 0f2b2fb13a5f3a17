"""Two best-view services: when one is killed or frozen, its viewers go on at the other, whose viewers notice
nothing; everybody keeps their number, also when it returns."""

from __future__ import annotations

import asyncio
import signal
import time
from pathlib import Path

import pytest

from client import watch
from fakes.running.several_services import FPS, configuration, several_services, watching
from fakes.timeouts import PATIENCE

_AFTER = round(4 * FPS)
"""Pulses for which the survivor is watched after the fault."""


@pytest.mark.parametrize(
    "how",
    [
        pytest.param(signal.SIGKILL, id="killed"),
        pytest.param(signal.SIGSTOP, id="frozen", marks=pytest.mark.slow),
    ],
)
async def test_the_other_service_goes_on_for_all_viewers_with_the_same_numbers(
    tmp_path: Path, how: signal.Signals
) -> None:
    async with asyncio.timeout(PATIENCE), several_services(configuration(tmp_path)) as site:
        first, second = [await site.numbers(index) for index in (0, 1)]
        assert first
        assert second
        async with watching(site.urls[1]) as survivor:
            await survivor.until(round(10 * FPS))  # the services agree
            number = (await site.numbers(1))[0]
            recording = asyncio.create_task(watch(site.urls[0], number, tmp_path / "one.mp4", 12.0))
            begun = survivor.last_pulse
            await survivor.until(begun + round(3 * FPS))
            faulty = site.running["bestview-0"]
            faulty.send(how)
            at = time.monotonic()
            await survivor.until(survivor.last_pulse + _AFTER)
            assert survivor.has_every_pulse()
            assert survivor.longest_wait(at) < PATIENCE
            if how is signal.SIGKILL:
                await faulty.process.wait()
                await site.start("bestview-0")
            else:
                faulty.send(signal.SIGCONT)
            result = await recording
            assert result.complete
            assert result.reconnections
            async with watching(site.urls[0]) as returned:
                await returned.until(survivor.last_pulse + _AFTER)
                await survivor.until(returned.last_pulse)
        boxes = [{gop.first: gop.boxes for _, gop in watched.gops} for watched in (returned, survivor)]
        last = max(boxes[0].keys() & boxes[1].keys())
        assert boxes[0][last] == boxes[1][last]  # and so the numbers
