"""More cameras than the machine carries: what is left out, what viewers see of it, and the way back; a plot.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.overload --out out/bench

A site of 1, 2, 3, … cameras of 352x288 at 25 a second, real processes, up to twice what the machine carries
without leaving anything out, or `--most`. Two viewers watch all the time. In the end all but one are killed.
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
from benchmarks.overload.growing_site import FPS, LOG, GrowingSite, running
from benchmarks.overload.overload_report import describe, plot
from benchmarks.overload.samples import RECOVERED_S, LoadStep, OverloadResult, SiteSample
from benchmarks.soak.visitors import Visitors

_STRIDE = 5
"""Frames between two windows, by default."""
_EVERY_S = 1.0
_FIRST_S = 120.0
"""A camera has so long to start, on a machine with other work."""
_CALM = 5
"""Samples in a row at which nothing is left out, for the way back to be over."""


class SiteSampler:
    """Samples a site."""

    def __init__(
        self, site: GrowingSite, visitors: Visitors, watching: asyncio.Task[None], found: OverloadResult
    ) -> None:
        self._site, self._visitors, self._watching, self._found = site, visitors, watching, found
        self._began = time.monotonic()

    @property
    def now(self) -> float:
        """Seconds since the beginning."""
        return time.monotonic() - self._began

    async def sample(self, session: aiohttp.ClientSession, seconds: float) -> list[SiteSample]:
        """Take samples for a while.

        Raises:
            RuntimeError: nobody watches any more: delays and holes would be those of nobody.
        """
        until, taken = self.now + seconds, []
        while self.now < until:
            await asyncio.wait({self._watching}, timeout=_EVERY_S)
            if self._watching.done():
                raise RuntimeError(f"the viewers ended: {self._watching.exception()!r}")
            async with session.get(f"{self._site.url}api/cameras") as answer:
                cameras = [
                    it for it in (await answer.json())["cameras"] if it["camera"] in self._site.cameras
                ]
            taken.append(self._sample(cameras))
        self._found.samples += taken
        return taken

    def _sample(self, cameras: Sequence[dict[str, Any]]) -> SiteSample:
        person, camera = self._visitors.person, self._visitors.camera
        delays = tuple(person.delays)
        person.delays.clear()
        camera.delays.clear()
        sums = {what: sum(it[what] for it in cameras) for what in ("pulse", "shed", "missed", "late")}
        return SiteSample(
            at=self.now,
            levels=tuple(it["load_level"] for it in cameras),
            pulses=sums["pulse"],
            shed=sums["shed"],
            missed=sums["missed"],
            late=sums["late"],
            delays=delays,
            holes=person.holes + camera.holes,
        )


def step_of(cameras: int, before: Sequence[SiteSample], samples: Sequence[SiteSample]) -> LoadStep:
    """Sum up the samples of so many cameras; ``before`` are those while they settled."""
    first, last = samples[0], samples[-1]
    frames = max(last.pulses - first.pulses, 1)
    delays = [it for sample in samples[1:] for it in sample.delays] or [np.nan]
    levels = [it for sample in samples for it in sample.levels] or [0]
    return LoadStep(
        cameras=cameras,
        levels=(float(np.median(levels)), max(levels)),
        searched=1.0 - (last.shed - first.shed + last.missed - first.missed) / frames,
        missed=(last.missed - first.missed) / frames,
        late=(last.late - first.late) / (frames / _STRIDE),
        delays=(float(np.median(delays)), float(np.percentile(delays, 95))),
        holes=last.holes - before[0].holes,
    )


async def load(site: GrowingSite, most: int, settle: float, seconds: float) -> OverloadResult:
    """Add cameras until there are too many by half; kill them, and wait until the rest is well."""
    found = OverloadResult()
    site.add()
    async with aiohttp.ClientSession() as session:
        await _first(session, site)
        visitors = Visitors(site.url, FPS, seed=1, coming=0)
        watching = asyncio.create_task(visitors.watch())
        try:
            watch = SiteSampler(site, visitors, watching, found)
            while True:
                found.started.append((watch.now, len(site.cameras)))
                before = await watch.sample(session, settle)
                samples = await watch.sample(session, seconds)
                found.steps.append(step_of(len(site.cameras), before, samples))
                enough = len(site.cameras) >= 2 * max(found.carried, 1) and len(found.steps) > found.carried
                if len(site.cameras) >= most or enough:
                    break
                site.add()
            await asyncio.to_thread(site.leave, 1)
            found.started.append((watch.now, 1))
            found.back = await _way_back(watch, session)
        finally:
            watching.cancel()
            await asyncio.gather(watching, return_exceptions=True)
    return found


async def _first(session: aiohttp.ClientSession, site: GrowingSite) -> None:
    """Wait until the first camera is live.

    Raises:
        RuntimeError: it does not come to that.
    """
    give_up = time.monotonic() + _FIRST_S
    while time.monotonic() < give_up:
        async with session.get(f"{site.url}api/cameras") as answer:
            if (await answer.json())["cameras"][0]["state"] == "live":
                return
        await asyncio.sleep(_EVERY_S)
    raise RuntimeError(f"the first camera was not live after {_FIRST_S:.0f} s")


async def _way_back(watch: SiteSampler, session: aiohttp.ClientSession) -> float | None:
    began = watch.now
    calm = 0
    while watch.now < began + RECOVERED_S:
        (*_, sample) = await watch.sample(session, _EVERY_S)
        calm = calm + 1 if max(sample.levels, default=0) == 0 else 0
        if calm == _CALM:
            return sample.at - began - (_CALM - 1) * _EVERY_S
    return None


def run(options: argparse.Namespace) -> None:
    """Run, print and save."""
    options.out.mkdir(parents=True, exist_ok=True)
    report = Report()
    with tempfile.TemporaryDirectory(prefix="myview-load-") as temporary:
        folder = Path(temporary)
        with running(options.most, folder) as site:
            found = asyncio.run(load(site, options.most, options.settle, options.seconds))
        (options.out / "overload.log").write_bytes((folder / LOG).read_bytes())
    describe(report, found)
    plot(found, options.out / "overload.png")
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
