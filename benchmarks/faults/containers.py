"""Fault injection in containers: killed, paused, restarted, disconnected.

    python -m benchmarks.faults.containers
    python -m benchmarks.faults.containers --fault "cut off camera"

The site is docker-compose.yml on the films of :mod:`benchmarks.faults`; the columns are the same. The engine
restarts killed containers; `docker network disconnect` removes a container's network interface without
notice. It needs a Docker Engine with Compose.
"""

from __future__ import annotations

import asyncio
import contextlib
import tempfile
import time
from collections.abc import AsyncIterator
from datetime import datetime
from pathlib import Path
from typing import Any

import yaml

from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.faults.injection.process_pairs import SHOWN
from benchmarks.faults.outcomes.measurement import measure
from benchmarks.faults.outcomes.promise_table import describe
from benchmarks.faults.site.compose_site import (
    PLAIN,
    ComposeSite,
    missing_requirement,
    run_compose_site,
)
from benchmarks.faults.site.docker_command import DockerError
from benchmarks.faults.site.fault_site import (
    LEASE_S,
    SETTINGS,
    Fault,
    FaultSite,
    Inject,
    ProcessExit,
    follow_events,
)
from benchmarks.faults.video.stamped_views import CAMERAS, StampedViews

_FILMS, _KEPT = "/site/films", "/site/kept"
_AWAY_S = 4.0
_ROUTER_AWAY_S = 30.0
_GRACE_S = 10


@contextlib.asynccontextmanager
async def with_containers(views: StampedViews, folder: Path) -> AsyncIterator[FaultSite]:
    """Run the site in containers; stop them in the end.

    Raises:
        CannotRunError: there is no Docker Engine.
        RuntimeError: the site does not start, or not into the expected state.
    """
    assert views.ground is not None  # noqa: S101 — the films have one
    films, kept = views.ground.parent, folder / "kept"
    films.chmod(0o755)  # the containers' user is another one
    kept.mkdir()
    kept.chmod(0o777)
    (folder / "site.yaml").write_text(yaml.safe_dump(films_site(views)), encoding="utf-8")
    mounted = [f"{films}:{_FILMS}:ro", f"{folder / 'site.yaml'}:/site/faults.yaml:ro"]
    services: dict[str, Any] = {name: {"volumes": mounted} for name in ("sync", "bestview", *CAMERAS)}
    services["bestview"] = {"volumes": [*mounted, f"{kept}:{_KEPT}"]}
    over = folder / "compose.yml"
    over.write_text(yaml.safe_dump({"services": services}), encoding="utf-8")
    with contextlib.ExitStack() as stack:
        opened = run_compose_site((*PLAIN, over), MYVIEW_CONFIG="../faults.yaml")
        site = await asyncio.to_thread(stack.enter_context, opened)
        url = f"http://{await asyncio.to_thread(site.address)}/"
        fault_site = FaultSite(url, folder, 0, control=site, recorded=kept)
        async with follow_events(fault_site):
            yield fault_site


def films_site(views: StampedViews) -> dict[str, Any]:
    """Return the configuration, with the paths of the films inside the containers."""
    cameras = [
        {**camera, **{key: f"{_FILMS}/{Path(camera[key]).name}" for key in ("source", "detections")}}
        for camera in views.cameras
    ]
    return {
        "site": views.site,
        "cameras": cameras,
        "ground": f"{_FILMS}/ground.json",
        "record": {**SETTINGS["record"], "folder": _KEPT},
    }


def _target(fault_site: FaultSite, name: str) -> tuple[ComposeSite, str, str]:
    """Return the site, the service called `name` and its container."""
    site: ComposeSite = fault_site.control
    service = fault_site.shown()[0] if name == SHOWN else name
    return site, service, site.container(service)


def kill_container(*names: str) -> Inject:
    """Kill all processes in containers except init, which exits with them.

    After `docker kill` the engine would not restart the container.
    """

    async def inject(fault_site: FaultSite) -> None:
        for name in names:
            site, _, container = _target(fault_site, name)
            with contextlib.suppress(DockerError):  # the shell that sends the signal dies, too
                await site.docker("exec", container, "sh", "-c", "kill -KILL -1")

    return inject


def pause_container(name: str, seconds: float = _AWAY_S) -> Inject:
    """Pause a container for a while."""

    async def inject(fault_site: FaultSite) -> None:
        site, _, container = _target(fault_site, name)
        await site.docker("pause", container)
        try:
            await asyncio.sleep(seconds)
        finally:
            await site.docker("unpause", container)

    return inject


def restart_container(name: str) -> Inject:
    """Stop a container, record how it exits, and start it again."""

    async def inject(fault_site: FaultSite) -> None:
        site, service, container = _target(fault_site, name)
        begun = time.time()
        await site.docker("stop", "--time", f"{_GRACE_S}", container)
        state = await asyncio.to_thread(site.state, service)
        finished = datetime.fromisoformat(state["FinishedAt"]).timestamp()
        fault_site.exits.append(ProcessExit(service, finished - begun, state["ExitCode"]))
        await site.docker("start", container)

    return inject


def disconnect_container(name: str, seconds: float = _AWAY_S) -> Inject:
    """Disconnect a container from the site's network for a while."""

    async def inject(fault_site: FaultSite) -> None:
        site, service, container = _target(fault_site, name)
        await site.docker("network", "disconnect", site.network, container)
        try:
            await asyncio.sleep(seconds)
        finally:
            await site.docker("network", "connect", "--alias", service, site.network, container)

    return inject


FAULTS = (
    Fault("kill camera", with_containers, kill_container(SHOWN), 10.0),
    Fault("kill sync", with_containers, kill_container("sync"), 10.0),
    Fault("kill sync+camera", with_containers, kill_container("sync", SHOWN), 10.0),
    Fault("pause camera", with_containers, pause_container(SHOWN), 10.0, LEASE_S + 1.0),
    Fault("pause sync", with_containers, pause_container("sync"), 10.0),
    Fault("pause bestview", with_containers, pause_container("bestview"), 10.0, None),
    Fault("restart camera", with_containers, restart_container(SHOWN), 12.0),
    Fault("restart sync", with_containers, restart_container("sync"), 12.0),
    Fault("cut off camera", with_containers, disconnect_container(SHOWN), 12.0, LEASE_S + 1.0),
    Fault("cut off sync", with_containers, disconnect_container("sync"), 12.0),
    Fault(
        "cut off bestview 30 s", with_containers, disconnect_container("bestview", _ROUTER_AWAY_S), 45.0, None
    ),
    Fault("kill bestview", with_containers, kill_container("bestview"), 30.0, None, kills_server=True),
    Fault("restart bestview", with_containers, restart_container("bestview"), 30.0, None, kills_server=True),
)


def main() -> None:
    """Read the command line, run and print."""
    options = parser(__doc__ or "", "faults.containers")
    names = [fault.name for fault in FAULTS]
    options.add_argument("--fault", action="append", choices=names, help="only this one; may be repeated")
    options.add_argument("--list", action="store_true", help="only list them")
    chosen = options.parse_args()
    if chosen.list:
        print("\n".join(names))
        return
    missing = missing_requirement()
    if missing is not None:
        finish(CannotRunError(missing), "faults.containers")
    report = Report()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:  # recordings are another user's
        faults = [fault for fault in FAULTS if not chosen.fault or fault.name in chosen.fault]
        outcomes = asyncio.run(measure(faults, Path(folder), report))
    describe(report, outcomes)
    report.save(chosen.out / "faults_containers.txt")


if __name__ == "__main__":
    main()
