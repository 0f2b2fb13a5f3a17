"""Whether a site with too much to do still answers: how long `/healthz` takes, with cameras nicer and not.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.load.health --cameras 8 --cameras 20 --cameras 40

Each site is `myview up` with small recorded pictures. From the moment of its start on it is asked twice a second,
whether or not it has answered yet: one that does not answer counts with the time that it was waited for. One row
for each number of cameras and each niceness, one after the other, so that both had about the same machine.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import signal
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import aiohttp
import numpy as np
import yaml

from benchmarks.report import Report
from benchmarks.surroundings import ROOT, one_thread_environment, parser
from server.camera.scene import Scene, write_recording
from server.run.setup import free_port

FPS, WIDTH, HEIGHT = 25.0, 192, 108
_FILMS, _PEOPLE, _SEED, _FILM_S = 4, 3, 1, 20.0
"""Views of the room; more cameras show the same again."""
_EVERY_S = 0.5
_METRICS_EVERY_S = 5.0
_END_S = 20.0
_LAG = "myview_loop_lag_seconds"
_FRAMES = "myview_camera_frames_total"
_MB = 1e3


@dataclass(slots=True)
class Asked:
    """What asking one site has come to.

    Attributes:
        began: when it was started, by a steady clock.
        waits: for each question when it was asked and how long it took, seconds; None: no answer came.
        lags: how late its loop was, by its own word: counts by upper edge in seconds, the newest.
        frames: camera frames received so far, and when.
        resident: megabytes of a camera's process, median, and of the best-view service's.
    """

    began: float
    waits: list[tuple[float, float | None]] = field(default_factory=list)
    lags: list[tuple[float, float]] = field(default_factory=list)
    frames: list[tuple[float, float]] = field(default_factory=list)
    resident: tuple[float, float] = (np.nan, np.nan)

    @property
    def first(self) -> float | None:
        """Seconds from the start to the first answer."""
        answered = [at + took - self.began for at, took in self.waits if took is not None]
        return min(answered, default=None)

    def after_first(self, end: float) -> list[float]:
        """Give how long each question took that was asked once it had answered; the open ones until the end."""
        first = self.first
        if first is None:
            return []
        return [
            end - at if took is None else took for at, took in self.waits if at - self.began >= first
        ]

    @property
    def rate(self) -> float:
        """Frames a second of all cameras together, in the last third of the time."""
        if len(self.frames) < 2:  # noqa: PLR2004
            return np.nan
        end = self.frames[-1]
        begin = next(it for it in self.frames if it[0] >= self.began + (end[0] - self.began) * 2 / 3 or it is self.frames[-2])
        return (end[1] - begin[1]) / (end[0] - begin[0])

    def lag(self, share: float) -> float:
        """Give the upper edge of the lag below which that share of its measurements lies."""
        if not self.lags:
            return np.nan
        return next((edge for edge, count in self.lags if count >= share * self.lags[-1][1]), np.inf)


async def ask(config: Path, port: int, niceness: int | None, seconds: float, log: Path) -> Asked:
    """Run a site for so long, and ask it from its start on."""
    environment = one_thread_environment()
    if niceness is not None:
        environment["MYVIEW_SITE__NICENESS"] = str(niceness)
    url = f"http://127.0.0.1:{port}/"
    with log.open("wb") as said:
        site = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "server.run.cli", "up", str(config),
            cwd=ROOT, env=environment, stdout=said, stderr=said,
        )
        asked = Asked(time.monotonic())
        try:
            timeout = aiohttp.ClientTimeout(total=None)
            connector = aiohttp.TCPConnector(force_close=True, limit=0)
            async with aiohttp.ClientSession(timeout=timeout, connector=connector) as session, asyncio.timeout(seconds):
                async with asyncio.TaskGroup() as asking:
                    asking.create_task(_metrics(session, url, asked))
                    while True:
                        asking.create_task(_ask(session, url, asked))
                        await asyncio.sleep(_EVERY_S)
        except TimeoutError:
            pass
        finally:
            asked.resident = resident(site.pid)
            site.send_signal(signal.SIGTERM)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(site.wait(), _END_S)
    return asked


async def _ask(session: aiohttp.ClientSession, url: str, asked: Asked) -> None:
    at = time.monotonic()
    try:
        async with session.get(f"{url}healthz") as answer:
            await answer.read()
    except aiohttp.ClientError:
        return  # nobody listens yet
    except asyncio.CancelledError:
        asked.waits.append((at, None))
        raise
    asked.waits.append((at, time.monotonic() - at))


async def _metrics(session: aiohttp.ClientSession, url: str, asked: Asked) -> None:
    while True:
        with contextlib.suppress(aiohttp.ClientError):
            async with session.get(f"{url}metrics") as answer:
                text = await answer.text()
            asked.lags = [
                (float(line.partition('le="')[2].partition('"')[0]), float(line.rpartition(" ")[2]))
                for line in text.splitlines() if line.startswith(f"{_LAG}_bucket")
            ]
            frames = sum(float(line.rpartition(" ")[2]) for line in text.splitlines() if line.startswith(f"{_FRAMES}{{"))
            asked.frames.append((time.monotonic(), frames))
        await asyncio.sleep(_METRICS_EVERY_S)


def resident(supervisor: int) -> tuple[float, float]:
    """Give the megabytes of the memory of a site's processes: a camera's, in the median, and the service's."""
    cameras, service = [np.nan], np.nan
    for folder in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError, StopIteration):
            words = (folder / "cmdline").read_bytes().decode().split("\0")
            status = (folder / "status").read_text().splitlines()
            of = {it.partition(":")[0]: it.partition(":")[2] for it in status}
            if int(of["PPid"]) != supervisor:
                continue
            size = float(of["VmRSS"].split()[0]) / _MB
            if "camera" in words:
                cameras.append(size)
            elif "bestview" in words:
                service = size
    return float(np.nanmedian(cameras)), service


def write_site(folder: Path, films: Path, cameras: int) -> tuple[Path, int]:
    """Write the configuration of a site of so many cameras; give it and the port of its page."""
    sync, bus, http = (free_port() for _ in range(3))
    address = f"tcp/127.0.0.1:{bus}"
    content = {
        "site": {"name": "load", "fps": FPS, "width": WIDTH, "height": HEIGHT},
        "sync": {"port": sync},
        "zenoh": {"connect": address, "listen": address},
        "http": {"port": http},
        "cameras": [
            {"id": f"c{it}", "source": str(films / f"c{it % _FILMS}.mp4"), "at_end": "loop"} for it in range(cameras)
        ],
    }
    path = folder / f"site-{cameras}-{http}.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path, http


def row(cameras: int, niceness: int | None, asked: Asked, seconds: float) -> list[str]:
    """Give a row of the table."""
    waits = asked.after_first(asked.began + seconds)
    first = "never" if asked.first is None else f"{asked.first:.1f}"
    p50, p95, most = (np.percentile(waits, it) if waits else np.nan for it in (50, 95, 100))
    return [
        str(cameras), "as is" if niceness is None else str(niceness), first,
        *(f"{1000 * it:.0f}" for it in (p50, p95, most)),
        f"{1000 * asked.lag(0.5):.0f}", f"{1000 * asked.lag(0.95):.0f}", f"{1000 * asked.lag(1):.0f}",
        f"{asked.rate:.0f}", f"{asked.resident[0]:.0f}", f"{asked.resident[1]:.0f}",
    ]


def run(options: argparse.Namespace) -> None:
    report = Report()
    rows = []
    with tempfile.TemporaryDirectory(prefix="myview-health-") as temporary:
        folder = Path(temporary)
        write_recording(Scene("room", _FILMS, _PEOPLE, _SEED, WIDTH, HEIGHT, FPS), folder / "films", _FILM_S)
        for cameras in options.cameras or [8, 20, 40]:
            for niceness in options.niceness or [None]:
                config, port = write_site(folder, folder / "films", cameras)
                log = options.out / "health.log"
                asked = asyncio.run(ask(config, port, niceness, options.seconds, log))
                rows.append(row(cameras, niceness, asked, options.seconds))
                print(rows[-1], os.getloadavg(), flush=True)
    report.table("x", ["cameras","nice","first s","p50","p95","max","lag50","lag95","lagmax","fps","cam MB","service MB"], rows)


def main() -> None:
    options = parser(__doc__, "load.health")
    options.add_argument("--cameras", type=int, action="append")
    options.add_argument("--niceness", type=int, action="append")
    options.add_argument("--seconds", type=float, default=60.0)
    given = options.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    run(given)


if __name__ == "__main__":
    main()
