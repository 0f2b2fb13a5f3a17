"""Overload: more cameras than the machine carries, load shedding, viewers and recovery; a plot.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.overload --out out/bench

A site of 1, 2, 3, … cameras of 352x288 at 25 frames a second, real processes, up to twice what the machine
carries without load shedding, or `--most`. Two viewers watch all the time. In the end all cameras but one are
killed.
"""

from __future__ import annotations

import argparse
import asyncio
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.overload.growing_site import FPS, LOG, GrowingSite, run_growing_site
from benchmarks.overload.overload_report import describe, plot
from benchmarks.overload.samples import RECOVERED_S, LoadStep, OverloadResult, SiteSample
from benchmarks.soak.visitors import Visitors

_STRIDE = 5
"""Frames between two windows, by default."""
_EVERY_S = 1.0
_FIRST_S = 120.0
"""Seconds in which the first camera must start."""
_CALM = 5
"""Consecutive samples without load shedding that end the recovery."""


class SiteSampler:
    """Samples a site periodically while viewers watch."""

    def __init__(
        self, site: GrowingSite, visitors: Visitors, viewers_task: asyncio.Task[None], result: OverloadResult
    ) -> None:
        self._site, self._visitors, self._viewers_task, self._result = site, visitors, viewers_task, result
        self._began = time.monotonic()

    @property
    def now(self) -> float:
        """Seconds since the beginning."""
        return time.monotonic() - self._began

    async def sample(self, session: aiohttp.ClientSession, seconds: float) -> list[SiteSample]:
        """Take samples for a while.

        Raises:
            RuntimeError: the viewers ended, so that there are no delays.
        """
        until, samples = self.now + seconds, []
        while self.now < until:
            await asyncio.wait({self._viewers_task}, timeout=_EVERY_S)
            if self._viewers_task.done():
                raise RuntimeError(f"the viewers ended: {self._viewers_task.exception()!r}")
            async with session.get(f"{self._site.url}api/cameras") as answer:
                cameras = [
                    camera
                    for camera in (await answer.json())["cameras"]
                    if camera["camera"] in self._site.cameras
                ]
            samples.append(self._sample(cameras))
        self._result.samples += samples
        return samples

    def _sample(self, cameras: Sequence[dict[str, Any]]) -> SiteSample:
        person, camera = self._visitors.person, self._visitors.camera
        delays = tuple(person.delays)
        person.delays.clear()
        camera.delays.clear()
        sums = {what: sum(camera[what] for camera in cameras) for what in ("pulse", "shed", "missed", "late")}
        return SiteSample(
            at=self.now,
            levels=tuple(camera["load_level"] for camera in cameras),
            pulses=sums["pulse"],
            shed=sums["shed"],
            missed=sums["missed"],
            late=sums["late"],
            delays=delays,
            missing_frames=person.missing_frames + camera.missing_frames,
        )


def summarize_step(cameras: int, before: Sequence[SiteSample], samples: Sequence[SiteSample]) -> LoadStep:
    """Summarize the samples of a number of cameras; ``before`` are those of the settling time."""
    first, last = samples[0], samples[-1]
    frames = max(last.pulses - first.pulses, 1)
    delays = [delay for sample in samples[1:] for delay in sample.delays] or [np.nan]
    levels = [level for sample in samples for level in sample.levels] or [0]
    return LoadStep(
        cameras=cameras,
        levels=(float(np.median(levels)), max(levels)),
        searched=1.0 - (last.shed - first.shed + last.missed - first.missed) / frames,
        missed=(last.missed - first.missed) / frames,
        late=(last.late - first.late) / (frames / _STRIDE),
        delays=(float(np.median(delays)), float(np.percentile(delays, 95))),
        missing_frames=last.missing_frames - before[0].missing_frames,
    )


async def load(site: GrowingSite, most: int, settle: float, seconds: float) -> OverloadResult:
    """Add cameras up to twice what is carried; kill all but one, and wait for the recovery."""
    result = OverloadResult()
    site.add()
    async with aiohttp.ClientSession() as session:
        await _wait_for_first_camera(session, site)
        visitors = Visitors(site.url, FPS, seed=1, count=0)
        viewers_task = asyncio.create_task(visitors.watch())
        try:
            sampler = SiteSampler(site, visitors, viewers_task, result)
            while True:
                result.started.append((sampler.now, len(site.cameras)))
                before = await sampler.sample(session, settle)
                samples = await sampler.sample(session, seconds)
                result.steps.append(summarize_step(len(site.cameras), before, samples))
                is_enough = (
                    len(site.cameras) >= 2 * max(result.cameras_carried, 1)
                    and len(result.steps) > result.cameras_carried
                )
                if len(site.cameras) >= most or is_enough:
                    break
                site.add()
            await asyncio.to_thread(site.kill_all_but, 1)
            result.started.append((sampler.now, 1))
            result.recovery_s = await _wait_for_recovery(sampler, session)
        finally:
            viewers_task.cancel()
            await asyncio.gather(viewers_task, return_exceptions=True)
    return result


async def _wait_for_first_camera(session: aiohttp.ClientSession, site: GrowingSite) -> None:
    """Wait until the first camera is live.

    Raises:
        RuntimeError: the camera does not become live.
    """
    give_up = time.monotonic() + _FIRST_S
    while time.monotonic() < give_up:
        async with session.get(f"{site.url}api/cameras") as answer:
            if (await answer.json())["cameras"][0]["state"] == "live":
                return
        await asyncio.sleep(_EVERY_S)
    raise RuntimeError(f"the first camera was not live after {_FIRST_S:.0f} s")


async def _wait_for_recovery(sampler: SiteSampler, session: aiohttp.ClientSession) -> float | None:
    began = sampler.now
    calm_samples = 0
    while sampler.now < began + RECOVERED_S:
        (*_, sample) = await sampler.sample(session, _EVERY_S)
        calm_samples = calm_samples + 1 if max(sample.levels, default=0) == 0 else 0
        if calm_samples == _CALM:
            return sample.at - began - (_CALM - 1) * _EVERY_S
    return None


def run(options: argparse.Namespace) -> None:
    """Run, print and save."""
    options.out.mkdir(parents=True, exist_ok=True)
    report = Report()
    with tempfile.TemporaryDirectory(prefix="myview-load-") as temporary:
        folder = Path(temporary)
        with run_growing_site(options.most, folder) as site:
            result = asyncio.run(load(site, options.most, options.settle, options.seconds))
        (options.out / "overload.log").write_bytes((folder / LOG).read_bytes())
    describe(report, result)
    plot(result, options.out / "overload.png")
    report.save(options.out / "overload.txt")


def main() -> None:
    """Read the command line and run."""
    options = parser(__doc__, "overload")
    options.add_argument("--most", type=int, default=16, help="cameras at most")
    options.add_argument("--settle", type=float, default=15.0, help="seconds after each camera's start")
    options.add_argument("--seconds", type=float, default=20.0, help="of each measurement")
    run(options.parse_args())


if __name__ == "__main__":
    main()
