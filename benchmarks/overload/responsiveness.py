"""Whether a site with too much to do still answers: `/healthz` and the loop's lag, cameras nicer and not.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.overload.responsiveness --cameras 40 --seconds 80

Each site is `myview up` with small recorded pictures. From its start on it is asked twice a second, whether
or not it has answered before: who is not answered at all counts with the time that they have waited. One row
for each number of cameras and each niceness, one after the other.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import aiohttp
import numpy as np
import yaml

from benchmarks.common.environment import ROOT, one_thread_environment, parser
from benchmarks.common.report import Report
from server.cli.generated_config import free_port
from server.http.metrics.event_loop_lag import LoopLag
from synthetic import Scene, write_recording

_FPS, _WIDTH, _HEIGHT = 25.0, 192, 108
_FILMS, _PEOPLE, _SEED, _FILM_S = 4, 3, 1, 20.0
"""Views of the room; more cameras show the same again."""
_ASK_EVERY_S, _METRICS_EVERY_S = 0.5, 5.0
_END_S = 20.0
_SETTLED = 2 / 3
"""Share of the time after which frames are counted: by then cameras have mostly started."""


@dataclass(slots=True)
class Responsiveness:
    """What came of asking one site.

    Attributes:
        seconds: for how long it ran.
        waits: when it was asked, seconds from its start, and how long the answer took; None: none has come.
        lags: how often its loop was later than by up to so many seconds, by its own metrics.
        frames: when it had received how many frames of all cameras.
        camera_mb: memory of a camera's process, in the median; what processes share is divided among them.
        service_mb: the best-view service's.
        own: how late this process's own loop was.
    """

    seconds: float
    waits: list[tuple[float, float | None]] = field(default_factory=list)
    lags: list[tuple[float, float]] = field(default_factory=list)
    frames: list[tuple[float, float]] = field(default_factory=list)
    camera_mb: float = np.nan
    service_mb: float = np.nan
    own: LoopLag = field(default_factory=LoopLag)

    @property
    def first(self) -> float:
        """Seconds from the start to the first answer; infinite: none came."""
        return min((at + took for at, took in self.waits if took is not None), default=np.inf)

    def wait(self, percent: float) -> float:
        """Return a percentile of the seconds that an answer took, once the first one had come."""
        took = [self.seconds - at if it is None else it for at, it in self.waits if at >= self.first]
        return float(np.percentile(took, percent)) if took else np.inf

    @property
    def rate(self) -> float:
        """Frames a second, of all cameras together, in the last part of the time."""
        late = [it for it in self.frames if it[0] >= _SETTLED * self.seconds]
        if not late or late[0] == late[-1]:
            return np.nan
        return (late[-1][1] - late[0][1]) / (late[-1][0] - late[0][0])


def lag_below(share: float, lags: Sequence[tuple[float, float]]) -> float:
    """Return the bound in seconds that so large a share of the lags does not pass."""
    return next((bound for bound, count in lags if count >= share * lags[-1][1]), np.nan)


async def ask(config: Path, port: int, niceness: int, seconds: float, log: Path) -> Responsiveness:
    """Run a site for so long, and ask it from its start on."""
    environment = {**one_thread_environment(), "MYVIEW_SITE__NICENESS": str(niceness)}
    url, asked = f"http://127.0.0.1:{port}/", Responsiveness(seconds)
    with log.open("ab") as said:
        site = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "server.cli.main", "up", str(config)),
            cwd=ROOT,
            env=environment,
            stdout=said,
            stderr=said,
        )
    began = time.monotonic()
    connector = aiohttp.TCPConnector(force_close=True, limit=0)  # as monitors come: each on its own
    session = aiohttp.ClientSession(timeout=aiohttp.ClientTimeout(total=None), connector=connector)
    try:
        with contextlib.suppress(TimeoutError):
            async with session, asyncio.timeout(seconds), asyncio.TaskGroup() as asking:
                asking.create_task(_metrics(session, url, asked, began))
                asking.create_task(asked.own.run())
                while True:
                    asking.create_task(_ask(session, url, asked, began))
                    await asyncio.sleep(_ASK_EVERY_S)
        asked.camera_mb, asked.service_mb = memory(site.pid)
    finally:
        site.send_signal(signal.SIGTERM)
        try:
            await asyncio.wait_for(site.wait(), _END_S)
        except TimeoutError:
            site.kill()
            await site.wait()
    return asked


async def _ask(session: aiohttp.ClientSession, url: str, asked: Responsiveness, began: float) -> None:
    at, took = time.monotonic() - began, None
    with contextlib.suppress(aiohttp.ClientConnectorError):  # nobody listens yet
        try:
            async with session.get(f"{url}healthz") as answer:
                await answer.read()
            took = time.monotonic() - began - at
        finally:
            asked.waits.append((at, took))


async def _metrics(session: aiohttp.ClientSession, url: str, asked: Responsiveness, began: float) -> None:
    while True:
        with contextlib.suppress(aiohttp.ClientError):
            async with session.get(f"{url}metrics") as answer:
                lines = (await answer.text()).splitlines()
            asked.lags = [
                (float(it.partition('le="')[2].partition('"')[0]), _value(it))
                for it in lines
                if it.startswith("myview_loop_lag_seconds_bucket")
            ]
            frames = sum(_value(it) for it in lines if it.startswith("myview_camera_frames_total"))
            asked.frames.append((time.monotonic() - began, frames))
        await asyncio.sleep(_METRICS_EVERY_S)


def _value(line: str) -> float:
    return float(line.rpartition(" ")[2])


def memory(supervisor: int) -> tuple[float, float]:
    """Return megabytes of a site's camera processes, in the median, and of its best-view service."""
    cameras, service = [], np.nan
    for folder in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError, IndexError):
            words = (folder / "cmdline").read_bytes().decode().split("\0")
            if int((folder / "stat").read_text().rpartition(")")[2].split()[1]) != supervisor:
                continue
            lines = (folder / "smaps_rollup").read_text().splitlines()
            size = next(float(it.split()[1]) / 1e3 for it in lines if it.startswith("Pss:"))
            if "camera" in words:
                cameras.append(size)
            elif "bestview" in words:
                service = size
    return float(np.median(cameras)) if cameras else np.nan, service


def write_site(folder: Path, films: Path, cameras: int) -> tuple[Path, int]:
    """Write the configuration of a site of so many cameras; give it and the port of its page."""
    sync, bus, http = (free_port() for _ in range(3))
    address = f"tcp/127.0.0.1:{bus}"
    content = {
        "site": {"name": "load", "fps": _FPS, "width": _WIDTH, "height": _HEIGHT},
        "sync": {"port": sync},
        "zenoh": {"connect": address, "listen": address},
        "http": {"port": http},
        "cameras": [
            {"id": f"c{it}", "source": str(films / f"c{it % _FILMS}.mp4"), "at_end": "loop"}
            for it in range(cameras)
        ],
    }
    path = folder / f"site-{http}.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path, http


def row(cameras: int, niceness: int, asked: Responsiveness) -> list[str]:
    """Return a row of the table."""
    [family] = asked.own.histogram.collect()
    own = [(float(it.labels["le"]), it.value) for it in family.samples if it.name.endswith("_bucket")]
    seconds = [asked.first, *(asked.wait(it) for it in (50, 95, 100))]
    bounds = [lag_below(0.95, asked.lags), lag_below(1.0, asked.lags), lag_below(0.95, own)]
    return [
        *(str(cameras), str(niceness)),
        *(f"{it:.2f}" for it in seconds),
        *(f"{it:g}" for it in bounds),
        *(f"{it:.0f}" for it in (asked.rate, asked.camera_mb, asked.service_mb)),
    ]


def run(options: argparse.Namespace) -> None:
    """Run, print and save."""
    options.out.mkdir(parents=True, exist_ok=True)
    report, rows = Report(), []
    log = options.out / "health.log"
    log.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory(prefix="myview-health-") as temporary:
        folder = Path(temporary)
        scene = Scene("room", _FILMS, _PEOPLE, _SEED, _WIDTH, _HEIGHT, _FPS)
        write_recording(scene, folder / "films", _FILM_S)
        for cameras in options.cameras or (8, 20, 40):
            for niceness in options.niceness or (0, 10):
                config, port = write_site(folder, folder / "films", cameras)
                asked = asyncio.run(ask(config, port, niceness, options.seconds, log))
                rows.append(row(cameras, niceness, asked))
    report.table(
        f"cameras of {_WIDTH}x{_HEIGHT} at {_FPS:g} a second, {options.seconds:g} s from the start",
        [
            *("cameras", "nicer by", "first, s", "p50, s", "p95, s", "most, s"),
            *("lag p95, s", "most, s", "own p95, s", "frames/s", "camera, MB", "service, MB"),
        ],
        rows,
    )
    report.say("first: the first answer, from the start; p50, p95, most: how long answers took from then on")
    report.say("lag: of the service's loop, at most; own: of who asks, which the machine's other work makes")
    report.say(f"frames/s: of all cameras, in the last {1 - _SETTLED:.0%} of the time; some may still start")
    report.save(options.out / "responsiveness.txt")


def main() -> None:
    """Read the command line and run."""
    options = parser(__doc__, "overload.responsiveness")
    options.add_argument("--cameras", type=int, action="append", help="may be repeated; 8, 20, 40")
    options.add_argument("--niceness", type=int, action="append", help="may be repeated; 0, 10")
    options.add_argument("--seconds", type=float, default=60.0, help="of each site")
    run(options.parse_args())


if __name__ == "__main__":
    main()
