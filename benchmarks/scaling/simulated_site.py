"""A site of simulated cameras with the real best-view process, and the measurement of its cost.

The site is configured for 25 frames a second, so that windows and waiting times have their usual lengths.
A large one gets slower pulses, by a pulse server of its own configuration.
"""

from __future__ import annotations

import contextlib
import subprocess
import time
import urllib.request
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from benchmarks.common.process_load import lag_percentile
from benchmarks.common.started_processes import start_module, terminate
from benchmarks.scaling.simulated_hall import FPS, HEIGHT, STRIDE, WIDTH, SimulatedHall
from benchmarks.scaling.timed_service import LISTS, REST, STAGES, ServiceTimes
from server.cli.generated_config import free_port

_PATIENCE_S = 120.0
_POLL_S = 0.2
_LOG = "site.log"


@dataclass(frozen=True, slots=True)
class SiteLoad:
    """The cost of a site for the best-view process.

    Attributes:
        cameras: of the site.
        people: in it.
        fps: pulses per second.
        services: best-view services that share the site; costs are their mean.
        per_camera: people in a camera's view, on average.
        stages: processor milliseconds per frame (of all cameras), by stage, including the rest.
        messages: per second, at 25 pulses a second.
        megabytes: per second, likewise.
        memory: resident megabytes at the end.
        late: late windows in the measured time.
        lag: seconds by which the event loop was late at most in 95 % of the measured time.
        epochs: measured epochs.
    """

    cameras: int
    people: int
    per_camera: int
    fps: float
    services: int
    stages: dict[str, float]
    messages: float
    megabytes: float
    memory: float
    late: int
    lag: float
    epochs: int

    @property
    def milliseconds(self) -> float:
        """Processor milliseconds per frame."""
        return sum(self.stages.values())


@dataclass(frozen=True, slots=True)
class _Service:
    """One best-view process."""

    process: subprocess.Popen[bytes]
    times: Path
    url: str


def measure_load(
    hall: SimulatedHall, fps: float, folder: Path, settle: int, epochs: int, services: int = 1
) -> SiteLoad:
    """Run the site for `settle` epochs, and measure over the `epochs` after them.

    Raises:
        RuntimeError: it does not get so far in time; the text has the logs.
    """
    folder.mkdir(parents=True)
    with _running(hall, fps, folder, services) as running:
        starts = [_after(service.times, settle, folder) for service in running]
        before = [_Metrics.read(service.url) for service in running]
        stops = [
            _after(service.times, start.epochs + epochs, folder)
            for service, start in zip(running, starts, strict=True)
        ]
        after = [_Metrics.read(service.url) for service in running]
        memory = sum(_resident(service.process.pid) for service in running) / services
    since = list(zip(before, after, strict=True))
    costs = [_costs(start, stop) for start, stop in zip(starts, stops, strict=True)]
    return SiteLoad(
        cameras=hall.cameras,
        people=hall.people,
        per_camera=hall.per_camera,
        fps=fps,
        services=services,
        stages={name: sum(cost.stages[name] for cost in costs) / services for name in costs[0].stages},
        messages=costs[0].messages,
        megabytes=costs[0].megabytes,
        memory=memory,
        late=sum(new.late - old.late for old, new in since),
        lag=max(new.lag_since(old) for old, new in since),
        epochs=costs[0].epochs,
    )


@dataclass(frozen=True, slots=True)
class _ServiceCosts:
    """What one service did between two measurements; fields as in `SiteLoad`."""

    stages: dict[str, float]
    messages: float
    megabytes: float
    epochs: int


def _costs(start: ServiceTimes, stop: ServiceTimes) -> _ServiceCosts:
    epochs = stop.epochs - start.epochs
    frames = STRIDE * epochs
    stages = {name: 1e3 * (stop.seconds[name] - start.seconds[name]) / frames for name in STAGES}
    stages[REST] = 1e3 * (stop.process - start.process) / frames - sum(stages.values())
    # Lists of people are sent by wall-clock time, whatever the pulse rate.
    stages[LISTS] *= frames / (FPS * (stop.at - start.at))
    messages = FPS * (stop.messages - start.messages) / frames
    return _ServiceCosts(stages, messages, FPS * (stop.size - start.size) / frames / 1e6, epochs)


@contextlib.contextmanager
def _running(hall: SimulatedHall, fps: float, folder: Path, services: int) -> Iterator[list[_Service]]:
    config, slow_pulses, routers = _write_configs(hall, fps, folder, services)
    https = [free_port() for _ in range(services)]
    halves = [range(hall.cameras // 2), range(hall.cameras // 2, hall.cameras)]
    with (folder / _LOG).open("wb") as log:
        started = [start_module(log, "server.cli.main", "sync", str(slow_pulses))]
        running = []
        for index, port in enumerate(https):
            times = folder / f"times{index}.json"
            own = {
                "MYVIEW_VIEW__SHARDING__INDEX": f"{index}",
                "MYVIEW_HTTP__PORT": f"{port}",
                "MYVIEW_ZENOH__LISTEN": routers[index],
            }
            words = ["benchmarks.scaling.timed_service", str(times), "bestview", str(config)]
            started.append(start_module(log, *words, **own))
            running.append(_Service(started[-1], times, f"http://127.0.0.1:{port}/"))
        started += [
            start_module(
                log,
                "benchmarks.scaling.simulated_cameras",
                str(config),
                f"{hall.per_camera}",
                f"{half.start}",
                f"{len(half)}",
            )
            for half in halves
        ]
        try:
            yield running
        finally:
            terminate(started)


def _write_configs(
    hall: SimulatedHall, fps: float, folder: Path, services: int
) -> tuple[Path, Path, list[str]]:
    """Write the configurations of the site and of its slower pulse server; return them and the routers."""
    routers = [f"tcp/127.0.0.1:{free_port()}" for _ in range(services)]
    site = {"name": "hall", "fps": FPS, "width": WIDTH, "height": HEIGHT}
    content = {
        "site": site,
        "sync": {"port": free_port(), "start_timeout_s": 3.0},
        "zenoh": {"connect": routers, "listen": routers[0]},
        "track": {"joint": False},  # simulated cameras send tracks alone
        # Slower pulses are later than the service expects.
        "view": {"late_after_s": 12.5 / fps, "sharding": {"of": services}},
        "cameras": [
            {"id": name, "source": f"rtsp://{name}/", "ground": ground.tolist()}
            for name, ground in zip(hall.ids, hall.grounds, strict=True)
        ],
    }
    config, slow_pulses = folder / "site.yaml", folder / "pulses.yaml"
    config.write_text(yaml.safe_dump(content), encoding="utf-8")
    slow_pulses.write_text(yaml.safe_dump(content | {"site": site | {"fps": fps}}), encoding="utf-8")
    return config, slow_pulses, routers


def _after(times: Path, epochs: int, folder: Path) -> ServiceTimes:
    """Wait until the service has decided so many epochs."""
    give_up = time.monotonic() + _PATIENCE_S
    while time.monotonic() < give_up:
        found = ServiceTimes.read(times)
        if found is not None and found.epochs >= epochs:
            return found
        time.sleep(_POLL_S)
    said = (folder / _LOG).read_text(encoding="utf-8", errors="replace")
    raise RuntimeError(f"the site did not reach epoch {epochs}; its log:\n{said[-2000:]}")


@dataclass(frozen=True, slots=True)
class _Metrics:
    """What a service says of itself: windows that were decided without their camera, and its loop's lag."""

    late: int
    lags: Mapping[float, float]
    """By bound in seconds, how often the event loop was late by at most that."""

    @classmethod
    def read(cls, url: str) -> _Metrics:
        with urllib.request.urlopen(f"{url}metrics", timeout=_PATIENCE_S) as answer:  # noqa: S310 — own address
            lines = answer.read().decode().splitlines()
        late = next(line for line in lines if line.startswith("myview_late_epochs_total"))
        lags = [line for line in lines if line.startswith("myview_loop_lag_seconds_bucket")]
        return cls(
            int(float(late.split()[1])),
            {float(line.split('"')[1]): float(line.rsplit(" ", 1)[1]) for line in lags},
        )

    def lag_since(self, before: _Metrics) -> float:
        """Return the bound below which 95 % of the lags since are."""
        return lag_percentile(
            0.95, [(bound, count - before.lags[bound]) for bound, count in self.lags.items()]
        )


def _resident(pid: int) -> float:
    lines = (Path("/proc") / str(pid) / "status").read_text().splitlines()
    return next(float(line.split()[1]) / 1e3 for line in lines if line.startswith("VmRSS"))
