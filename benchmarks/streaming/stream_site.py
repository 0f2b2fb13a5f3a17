"""The site of the streaming benchmark: pulses, simulated cameras, the real best-view process, viewers."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec
import yaml

from benchmarks.common.environment import ROOT, one_thread_environment
from benchmarks.common.started_processes import start_module, terminate
from benchmarks.scaling.simulated_hall import SimulatedHall
from benchmarks.streaming import timed_service
from benchmarks.streaming.simulated_cameras import CAMERAS, ENCODE, SITE, save
from benchmarks.streaming.viewer_crowd import CrowdReading
from server.camera.encoder import AccessUnit
from server.cli.generated_config import free_port

PER_CAMERA = 20
"""People per camera on average: some sixty in the hall."""
_TIMEOUT_S = 90.0
_POLL_S = 0.2
_LOG = "site.log"
_NO_LIMIT = 100_000
_TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")


class ViewerProcess:
    """A process of viewers (:mod:`benchmarks.streaming.viewer_crowd`)."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self.process = process

    def watch(self, paths: Sequence[str], seconds: float = 0.0) -> CrowdReading:
        """Replace the viewers by one for each path, and read for some seconds."""
        return self._run({"watch": list(paths), "for": seconds})

    def read(self, seconds: float) -> CrowdReading:
        """Read for some seconds."""
        return self._run({"for": seconds})

    def _run(self, command: object) -> CrowdReading:
        assert self.process.stdin is not None  # noqa: S101 — it was started with pipes
        assert self.process.stdout is not None  # noqa: S101 — it was started with pipes
        self.process.stdin.write(msgspec.json.encode(command) + b"\n")
        self.process.stdin.flush()
        return msgspec.json.decode(self.process.stdout.readline(), type=CrowdReading)


class StreamSite:
    """A running site."""

    def __init__(self, http: int, service: subprocess.Popen[bytes], folder: Path) -> None:
        self.http, self.folder = http, folder
        self.pid = service.pid

    @property
    def processor_seconds(self) -> float:
        """Processor seconds of the best-view process since its start."""
        words = Path(f"/proc/{self.pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        return (int(words[11]) + int(words[12])) * _TICK_S

    @property
    def sent(self) -> dict[int, timed_service.SendTimes]:
        """When each GOP was sent to the viewers, by its first pulse."""
        return timed_service.read(self.folder / "sent")

    def objects(self, count: int) -> list[int]:
        """Wait until there are `count` objects, and return all objects' numbers.

        Raises:
            RuntimeError: they do not appear in time; the text has the logs.
        """
        deadline = time.monotonic() + _TIMEOUT_S
        while time.monotonic() < deadline:
            with contextlib.suppress(urllib.error.URLError, ConnectionError):
                address = f"http://127.0.0.1:{self.http}/api/objects"
                with urllib.request.urlopen(address, timeout=_TIMEOUT_S) as answer:
                    numbers = [entry["object"] for entry in json.load(answer)["objects"]]
                if len(numbers) >= count:
                    return numbers
            time.sleep(_POLL_S)
        log = (self.folder / _LOG).read_text(encoding="utf-8", errors="replace")
        raise RuntimeError(f"{count} people did not appear; the site's log:\n{log[-2000:]}")


@contextlib.contextmanager
def running(films: Sequence[Sequence[AccessUnit]], folder: Path) -> Iterator[StreamSite]:
    """Run a site whose cameras send these films."""
    folder.mkdir(parents=True)
    save([list(film) for film in films], folder / "films")
    sync, bus, http = (free_port() for _ in range(3))
    hall = SimulatedHall(CAMERAS, PER_CAMERA)
    config, address = folder / "site.yaml", f"tcp/127.0.0.1:{bus}"
    content = {
        "site": {"name": SITE.name, "fps": SITE.fps, "width": SITE.width, "height": SITE.height},
        "encode": {"gop_s": ENCODE.gop_s},
        "sync": {"port": sync, "start_timeout_s": 3.0},
        "zenoh": {"connect": address, "listen": address},
        "track": {"joint": False},  # simulated cameras send tracks alone
        "http": {"port": http, "viewers_max": _NO_LIMIT, "viewers_per_object": _NO_LIMIT},
        "cameras": [
            {"id": name, "source": f"rtsp://{name}/", "ground": ground.tolist()}
            for name, ground in zip(hall.ids, hall.grounds, strict=True)
        ],
    }
    config.write_text(yaml.safe_dump(content), encoding="utf-8")
    with (folder / _LOG).open("wb") as log:
        processes = [start_module(log, "server.cli.main", "sync", str(config))]
        service = start_module(
            log, "benchmarks.streaming.timed_service", str(folder / "sent"), "bestview", str(config)
        )
        cameras = [str(config), str(folder / "films"), f"{PER_CAMERA}"]
        processes += [service, start_module(log, "benchmarks.streaming.simulated_cameras", *cameras)]
        try:
            yield StreamSite(http, service, folder)
        finally:
            terminate(processes)


@contextlib.contextmanager
def viewers(port: int) -> Iterator[ViewerProcess]:
    """Run a process of viewers of a local server."""
    pipe = subprocess.PIPE
    words = [sys.executable, "-m", "benchmarks.streaming.viewer_crowd", f"{port}"]
    process = subprocess.Popen(words, cwd=ROOT, env=one_thread_environment(), stdin=pipe, stdout=pipe)
    try:
        yield ViewerProcess(process)
    finally:
        terminate([process])
        for stream in (process.stdin, process.stdout):
            assert stream is not None  # noqa: S101 — it was started with pipes
            stream.close()
