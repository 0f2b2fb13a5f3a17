"""A stack of Docker Swarm with two best-view services: one container of each kind is killed under viewers.

    python -m benchmarks.faults.failover.swarm

The stack is that of docker-compose.yml and docker-compose.standby.yml by `configs/swarm.py`, on the films of
:mod:`benchmarks.faults`; the columns are those of :mod:`benchmarks.faults.failover`. Swarm starts a killed
container again. It needs a Docker Engine with Compose, which becomes a swarm until the end if it is none.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import tempfile
import uuid
from collections.abc import AsyncIterator, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from benchmarks.common.environment import ROOT, CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.faults.containers import films_site
from benchmarks.faults.failover.failover_run import FailoverOutcome, check_recordings, run
from benchmarks.faults.failover.failover_table import describe
from benchmarks.faults.failover.failures import CAMERA, FOLLOWER, LEADER, Failure
from benchmarks.faults.failover.two_services import SiteOfServices
from benchmarks.faults.site.compose_site import missing_requirement
from benchmarks.faults.site.docker_command import COMMAND_S, run_command
from benchmarks.faults.site.fault_site import FaultSite, follow_events
from benchmarks.faults.video.stamped_views import CAMERAS, StampedViews, make
from server.cli.generated_config import free_port

FILES = ("docker-compose.yml", "docker-compose.standby.yml")
SERVICES = ("bestview", "bestview-1")
_FILMS, _KEPT = "/site/films", "/site/kept"
_PULSES = 20_000
_BUILD_S, _START_S = 900.0, 300.0


@dataclass(frozen=True, slots=True)
class Docker:
    """Runs Docker's command line."""

    environment: Mapping[str, str]

    def run(self, *words: str, text: str = "", seconds: float = COMMAND_S) -> str:
        """Run a command with a text as its input; return its output.

        Raises:
            DockerError: it fails or does not end.
        """
        return run_command(words, self.environment, text=text, seconds=seconds)


@dataclass(slots=True)
class SwarmSite(SiteOfServices):
    """A running stack."""

    docker: Docker
    stack: str

    def pid(self, name: str) -> int:
        """Return 0: containers are killed by name."""
        del name
        return 0

    async def kill(self, name: str) -> None:
        """Kill a service's container."""
        service = {"bestview-0": SERVICES[0]}.get(name, name)
        label = f"label=com.docker.swarm.service.name={self.stack}_{service}"
        words = ("docker", "ps", "--quiet", "--filter", label)
        container = await asyncio.to_thread(self.docker.run, *words)
        await asyncio.to_thread(self.docker.run, "docker", "kill", container)


async def _kill(site: SwarmSite, name: str, pid: int) -> None:
    del pid
    await site.kill(name)


FAILURES = tuple(Failure("kill", target, _kill) for target in (LEADER, FOLLOWER, CAMERA, "sync"))


@contextlib.contextmanager
def _swarm(docker: Docker) -> Iterator[None]:
    """Make the engine a swarm, and leave it at the end, unless it is one."""
    state = docker.run("docker", "info", "--format", "{{.Swarm.LocalNodeState}}")
    if state == "active":
        yield
        return
    docker.run("docker", "swarm", "init", "--advertise-addr", "127.0.0.1")
    try:
        yield
    finally:
        docker.run("docker", "swarm", "leave", "--force")


def _deploy(docker: Docker, stack: str, files: tuple[str, ...]) -> None:
    named = [word for file in files for word in ("--file", file)]
    docker.run("docker", "compose", *named, "build", seconds=_BUILD_S)
    composed = docker.run("docker", "compose", *named, "config", "--format", "json")
    content = docker.run(sys.executable, str(ROOT / "configs" / "swarm.py"), text=composed)
    words = ("docker", "stack", "deploy", "--resolve-image", "never", "--detach=true", "-c", "-", stack)
    docker.run(*words, text=content)


@contextlib.asynccontextmanager
async def run_stack(views: StampedViews, folder: Path) -> AsyncIterator[SwarmSite]:
    """Deploy the stack; remove it at the end.

    Raises:
        RuntimeError: it does not become healthy.
    """
    assert views.ground is not None  # noqa: S101 — the films have one
    films = views.ground.parent
    films.chmod(0o755)  # the containers' user is another one
    (folder / "site.yaml").write_text(yaml.safe_dump(films_site(views)), encoding="utf-8")
    mounted = [f"{films}:{_FILMS}:ro", f"{folder / 'site.yaml'}:/site/faults.yaml:ro"]
    services: dict[str, Any] = {name: {"volumes": mounted} for name in ("sync", *CAMERAS)}
    for index, name in enumerate(SERVICES):
        kept = folder / f"kept-{index}"
        kept.mkdir()
        kept.chmod(0o777)
        services[name] = {"volumes": [*mounted, f"{kept}:{_KEPT}"]}
    over = folder / "compose.yml"
    over.write_text(yaml.safe_dump({"services": services}), encoding="utf-8")
    ports = [free_port() for _ in SERVICES]
    urls = [f"http://127.0.0.1:{port}/" for port in ports]
    stack = f"myview-test-{uuid.uuid4().hex[:8]}"
    plain = {
        name: value for name, value in os.environ.items() if not name.startswith(("MYVIEW_", "COMPOSE_"))
    }
    docker = Docker(
        {
            **plain,
            "COMPOSE_PROJECT_NAME": stack,
            "MYVIEW_CONFIG": "../faults.yaml",
            "MYVIEW_PUBLISH": str(ports[0]),
            "MYVIEW_PUBLISH_1": str(ports[1]),
            "MYVIEW_URL": urls[0],
            "MYVIEW_URL_1": urls[1],
        }
    )
    with contextlib.ExitStack() as closing:
        await asyncio.to_thread(closing.enter_context, _swarm(docker))
        closing.callback(docker.run, "docker", "stack", "rm", stack)
        await asyncio.to_thread(_deploy, docker, stack, (*FILES, str(over)))
        sites = [
            FaultSite(url, folder, 0, recorded=folder / f"kept-{index}") for index, url in enumerate(urls)
        ]
        async with follow_events(sites[0], _START_S), follow_events(sites[1], _START_S):
            yield SwarmSite(tuple(sites), "", docker, stack)


async def measure(folder: Path) -> list[FailoverOutcome]:
    """Kill one container of each kind."""
    views = await asyncio.to_thread(make, folder, _PULSES)
    own = folder / "stack"
    await asyncio.to_thread(own.mkdir)
    outcomes = []
    async with run_stack(views, own) as site:
        for failure in FAILURES:
            outcomes.append(await run(failure, site, views, None))
            print(f"{failure.name}: done", file=sys.stderr, flush=True)
    await asyncio.to_thread(check_recordings, outcomes, site)
    return outcomes


def main() -> None:
    """Read the command line, run, print."""
    chosen = parser(__doc__ or "", "faults.failover.swarm").parse_args()
    missing = missing_requirement()
    if missing is not None:
        finish(CannotRunError(missing), "faults.failover.swarm")
    report = Report()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:  # recordings are another user's
        outcomes = asyncio.run(measure(Path(folder)))
    describe(report, outcomes)
    report.save(chosen.out / "failover_swarm.txt")


if __name__ == "__main__":
    main()
