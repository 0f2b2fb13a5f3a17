"""A site of simulated cameras: pulses, the real best-view process, and what it used between two moments."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import yaml

from benchmarks.scaling_hall import HEIGHT, STRIDE, WIDTH, Hall
from benchmarks.scaling_service import LISTS, REST, STAGES, Times
from benchmarks.surroundings import ROOT, one_thread_environment
from server.run.setup import free_port

_PATIENCE_S = 120.0
_POLL_S = 0.2
_LOG = "site.log"


@dataclass(frozen=True, slots=True)
class Load:
    """What carrying a site costs the best-view process.

    Attributes:
        cameras: of the site.
        people: in it.
        fps: pulses a second.
        per_camera: people in a camera's view, on average.
        stages: processor milliseconds a frame (of all cameras together) by stage, the rest too.
        messages: a second, at 25 pulses a second.
        megabytes: likewise.
        memory: resident megabytes at the end.
        late: windows that came too late, in the measured time.
        epochs: measured.
    """

    cameras: int
    people: int
    per_camera: int
    fps: float
    stages: dict[str, float]
    messages: float
    megabytes: float
    memory: float
    late: int
    epochs: int

    @property
    def milliseconds(self) -> float:
        """Processor milliseconds a frame."""
        return sum(self.stages.values())


def carry(hall: Hall, fps: float, folder: Path, settle: int, epochs: int) -> Load:
    """Run the site for `settle` epochs, and measure over the `epochs` after them.

    Raises:
        RuntimeError: it did not come so far in time; what the processes said is in the text.
    """
    folder.mkdir(parents=True)
    times = folder / "times.json"
    with _running(hall, fps, folder, times) as (service, url):
        start = _after(times, settle, folder)
        late = _late(url)
        stop = _after(times, start.epochs + epochs, folder)
        late = _late(url) - late
        memory = _resident(service.pid)
    frames = STRIDE * (stop.epochs - start.epochs)
    stages = {name: 1e3 * (stop.seconds[name] - start.seconds[name]) / frames for name in STAGES}
    stages[REST] = 1e3 * (stop.process - start.process) / frames - sum(stages.values())
    # The lists are told by the clock, whatever the rate of the pulses.
    stages[LISTS] *= frames / (25.0 * (stop.at - start.at))
    return Load(
        cameras=hall.cameras,
        people=hall.people,
        per_camera=hall.per_camera,
        fps=fps,
        stages=stages,
        messages=25.0 * (stop.messages - start.messages) / frames,
        megabytes=25.0 * (stop.size - start.size) / frames / 1e6,
        memory=memory,
        late=late,
        epochs=stop.epochs - start.epochs,
    )


@contextlib.contextmanager
def _running(
    hall: Hall, fps: float, folder: Path, times: Path
) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    sync, bus, http = (free_port() for _ in range(3))
    config = folder / "site.yaml"
    address = f"tcp/127.0.0.1:{bus}"
    content = {
        "site": {"name": "hall", "fps": fps, "width": WIDTH, "height": HEIGHT},
        "sync": {"port": sync, "start_timeout_s": 3.0},
        "zenoh": {"connect": address, "listen": address},
        "http": {"port": http},
        # The rate is set to what is measured, not to what people would see: waiting is counted in frames.
        "view": {"late_after_s": 12.5 / fps},
        "cameras": [
            {"id": name, "source": f"rtsp://{name}/", "ground": ground.tolist()}
            for name, ground in zip(hall.ids, hall.grounds, strict=True)
        ],
    }
    config.write_text(yaml.safe_dump(content), encoding="utf-8")
    halves = [range(hall.cameras // 2), range(hall.cameras // 2, hall.cameras)]
    commands = [
        ["server.run.cli", "sync", str(config)],
        ["benchmarks.scaling_service", str(times), "bestview", str(config)],
        *(
            ["benchmarks.scaling_cameras", str(config), f"{hall.per_camera}", f"{it.start}", f"{len(it)}"]
            for it in halves
        ),
    ]
    environment = {**one_thread_environment(), "MYVIEW_SUPERVISED": "1"}
    with (folder / _LOG).open("wb") as log:
        started = [
            subprocess.Popen(
                [sys.executable, "-m", *words], cwd=ROOT, env=environment, stdout=log, stderr=log
            )
            for words in commands
        ]
        try:
            yield started[1], f"http://127.0.0.1:{http}/"
        finally:
            for process in started:
                process.terminate()
            for process in started:
                try:
                    process.wait(15.0)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


def _after(times: Path, epochs: int, folder: Path) -> Times:
    """Wait until the service has decided so many epochs."""
    give_up = time.monotonic() + _PATIENCE_S
    while time.monotonic() < give_up:
        found = Times.read(times)
        if found is not None and found.epochs >= epochs:
            return found
        time.sleep(_POLL_S)
    said = (folder / _LOG).read_text(encoding="utf-8", errors="replace")
    raise RuntimeError(f"the site did not come to epoch {epochs}; its processes said:\n{said[-2000:]}")


def _late(url: str) -> int:
    """Windows that were decided without a camera that was there."""
    with urllib.request.urlopen(f"{url}metrics", timeout=_PATIENCE_S) as answer:  # noqa: S310 — own address
        metrics = answer.read().decode()
    return next(
        int(float(line.split()[1]))
        for line in metrics.splitlines()
        if line.startswith("myview_late_epochs_total")
    )


def _resident(pid: int) -> float:
    lines = (Path("/proc") / str(pid) / "status").read_text().splitlines()
    return next(float(line.split()[1]) / 1e3 for line in lines if line.startswith("VmRSS"))
