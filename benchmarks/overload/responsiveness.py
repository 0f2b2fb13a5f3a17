"""Responsiveness of an overloaded site: `/healthz` and event loop lag, with and without niceness of cameras.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.overload.responsiveness --cameras 40 --seconds 80

Each site is `myview up` on small recordings. From its start on a request is sent twice a second, whether or
not the previous ones were answered; an unanswered request counts with the time it has waited. One row for
each number of cameras and each niceness.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import aiohttp
import numpy as np
import yaml

from benchmarks.common.environment import ROOT, one_thread_environment, parser
from benchmarks.common.process_load import lag_percentile
from benchmarks.common.report import Report
from server.cli.generated_config import free_port
from server.http.metrics.event_loop_lag import LoopLag
from synthetic import Scene, write_recording

_FPS, _WIDTH, _HEIGHT = 25.0, 192, 108
_FILMS, _PEOPLE, _SEED, _FILM_S = 4, 3, 1, 20.0
"""Views of the room; further cameras repeat them."""
_ASK_EVERY_S, _METRICS_EVERY_S = 0.5, 5.0
_END_S = 20.0
_SETTLED = 2 / 3
"""Share of the time after which frames are counted: most cameras have started by then."""


@dataclass(slots=True)
class Responsiveness:
    """The measurements of one site.

    Attributes:
        seconds: for how long it ran.
        response_times: time of each request, seconds from the start, and of its response; None: unanswered.
        lags: cumulative histogram of its event loop lag, from its metrics: bound in seconds, count.
        frames: time, and frames received from all cameras so far.
        camera_mb: median memory (PSS) of a camera process.
        service_mb: memory (PSS) of the best-view service.
        own_lag: the event loop lag of this process.
    """

    seconds: float
    response_times: list[tuple[float, float | None]] = field(default_factory=list)
    lags: list[tuple[float, float]] = field(default_factory=list)
    frames: list[tuple[float, float]] = field(default_factory=list)
    camera_mb: float = np.nan
    service_mb: float = np.nan
    own_lag: LoopLag = field(default_factory=LoopLag)

    @property
    def first_response_s(self) -> float:
        """Seconds from the start to the first response; infinite: there was none."""
        return min((at + took for at, took in self.response_times if took is not None), default=np.inf)

    def response_time(self, percent: float) -> float:
        """Return a percentile of the response times, seconds, after the first response."""
        took = [
            self.seconds - at if time is None else time
            for at, time in self.response_times
            if at >= self.first_response_s
        ]
        return float(np.percentile(took, percent)) if took else np.inf

    @property
    def rate(self) -> float:
        """Frames per second of all cameras in the last part of the time."""
        late = [frame for frame in self.frames if frame[0] >= _SETTLED * self.seconds]
        if not late or late[0] == late[-1]:
            return np.nan
        return (late[-1][1] - late[0][1]) / (late[-1][0] - late[0][0])


async def measure_site(config: Path, port: int, niceness: int, seconds: float, log: Path) -> Responsiveness:
    """Run a site for a while, and send requests from its start on."""
    environment = {**one_thread_environment(), "MYVIEW_SITE__NICENESS": str(niceness)}
    url, measured = f"http://127.0.0.1:{port}/", Responsiveness(seconds)
    with log.open("ab") as log_file:
        site = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "server.cli.main", "up", str(config)),
            cwd=ROOT,
            env=environment,
            stdout=log_file,
            stderr=log_file,
        )
    began = time.monotonic()
    connector = aiohttp.TCPConnector(force_close=True, limit=0)  # one connection per request, as monitors do
    session = aiohttp.ClientSession(timeout=aiohttp.ClientTimeout(total=None), connector=connector)
    try:
        with contextlib.suppress(TimeoutError):
            async with session, asyncio.timeout(seconds), asyncio.TaskGroup() as asking:
                asking.create_task(_metrics(session, url, measured, began))
                asking.create_task(measured.own_lag.run())
                while True:
                    asking.create_task(_request(session, url, measured, began))
                    await asyncio.sleep(_ASK_EVERY_S)
        measured.camera_mb, measured.service_mb = memory(site.pid)
    finally:
        site.send_signal(signal.SIGTERM)
        try:
            await asyncio.wait_for(site.wait(), _END_S)
        except TimeoutError:
            site.kill()
            await site.wait()
    return measured


async def _request(session: aiohttp.ClientSession, url: str, measured: Responsiveness, began: float) -> None:
    at, took = time.monotonic() - began, None
    with contextlib.suppress(aiohttp.ClientConnectorError):  # the server is not up yet
        try:
            async with session.get(f"{url}healthz") as answer:
                await answer.read()
            took = time.monotonic() - began - at
        finally:
            measured.response_times.append((at, took))


async def _metrics(session: aiohttp.ClientSession, url: str, measured: Responsiveness, began: float) -> None:
    while True:
        with contextlib.suppress(aiohttp.ClientError):
            async with session.get(f"{url}metrics") as answer:
                lines = (await answer.text()).splitlines()
            measured.lags = [
                (float(line.partition('le="')[2].partition('"')[0]), _value(line))
                for line in lines
                if line.startswith("myview_loop_lag_seconds_bucket")
            ]
            frames = sum(_value(line) for line in lines if line.startswith("myview_camera_frames_total"))
            measured.frames.append((time.monotonic() - began, frames))
        await asyncio.sleep(_METRICS_EVERY_S)


def _value(line: str) -> float:
    return float(line.rpartition(" ")[2])


def memory(supervisor: int) -> tuple[float, float]:
    """Return the median memory of a site's camera processes, and that of its best-view service, megabytes."""
    cameras, service = [], np.nan
    for folder in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError, IndexError):
            words = (folder / "cmdline").read_bytes().decode().split("\0")
            if int((folder / "stat").read_text().rpartition(")")[2].split()[1]) != supervisor:
                continue
            lines = (folder / "smaps_rollup").read_text().splitlines()
            size = next(float(line.split()[1]) / 1e3 for line in lines if line.startswith("Pss:"))
            if "camera" in words:
                cameras.append(size)
            elif "bestview" in words:
                service = size
    return float(np.median(cameras)) if cameras else np.nan, service


def write_site(folder: Path, films: Path, cameras: int) -> tuple[Path, int]:
    """Write the configuration of a site; return its path and the port of the page."""
    sync, bus, http = (free_port() for _ in range(3))
    address = f"tcp/127.0.0.1:{bus}"
    content = {
        "site": {"name": "load", "fps": _FPS, "width": _WIDTH, "height": _HEIGHT},
        "sync": {"port": sync},
        "zenoh": {"connect": address, "listen": address},
        "http": {"port": http},
        "cameras": [
            {"id": f"c{number}", "source": str(films / f"c{number % _FILMS}.mp4"), "at_end": "loop"}
            for number in range(cameras)
        ],
    }
    path = folder / f"site-{http}.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path, http


def row(cameras: int, niceness: int, measured: Responsiveness) -> list[str]:
    """Return a row of the table."""
    [family] = measured.own_lag.histogram.collect()
    own_lag = [
        (float(sample.labels["le"]), sample.value)
        for sample in family.samples
        if sample.name.endswith("_bucket")
    ]
    seconds = [measured.first_response_s, *(measured.response_time(percent) for percent in (50, 95, 100))]
    bounds = [
        lag_percentile(0.95, measured.lags),
        lag_percentile(1.0, measured.lags),
        lag_percentile(0.95, own_lag),
    ]
    return [
        *(str(cameras), str(niceness)),
        *(f"{second:.2f}" for second in seconds),
        *(f"{bound:g}" for bound in bounds),
        *(f"{value:.0f}" for value in (measured.rate, measured.camera_mb, measured.service_mb)),
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
                measured = asyncio.run(measure_site(config, port, niceness, options.seconds, log))
                rows.append(row(cameras, niceness, measured))
    report.table(
        f"cameras of {_WIDTH}x{_HEIGHT} at {_FPS:g} a second, {options.seconds:g} s from the start",
        [
            *("cameras", "niceness", "first, s", "p50, s", "p95, s", "max., s"),
            *("lag p95, s", "max., s", "own p95, s", "frames/s", "camera, MB", "service, MB"),
        ],
        rows,
    )
    report.line("first: time to the first response; p50, p95, max.: response times from then on")
    report.line("lag: of the service's event loop, at most; own: of the measuring process, for comparison")
    report.line(
        f"frames/s: of all cameras, in the last {1 - _SETTLED:.0%} of the time; some may still be starting"
    )
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
