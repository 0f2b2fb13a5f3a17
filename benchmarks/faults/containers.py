"""The same kinds of faults in containers: killed, paused, restarted, cut off from each other.

    python -m benchmarks.faults.containers
    python -m benchmarks.faults.containers --fault "cut off camera"

The site is docker-compose.yml on the films of :mod:`benchmarks.faults`, whose columns these are too. The
engine starts again what dies, and the network between two containers is cut as `docker network disconnect`
does it: the container's interface is gone, nobody is told. It needs a Docker Engine with Compose.
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
from benchmarks.faults.site.compose_site import PLAIN, ComposeError, ComposeSite, composed, missing
from benchmarks.faults.site.fault_site import (
    LEASE_S,
    SETTINGS,
    Fault,
    FaultSite,
    Inject,
    ProcessExit,
    listening,
)
from benchmarks.faults.video.stamped_views import CAMERAS, StampedViews

_FILMS, _KEPT = "/site/films", "/site/kept"
_AWAY_S = 4.0
_ROUTER_AWAY_S = 30.0
_GRACE_S = 10


@contextlib.asynccontextmanager
async def with_containers(views: StampedViews, folder: Path) -> AsyncIterator[FaultSite]:
    """Run the films in containers; in the end tell all of them to end.

    Raises:
        CannotRunError: there is no engine here.
        RuntimeError: the site does not come up, or not to what it should be.
    """
    assert views.ground is not None  # noqa: S101 — the films have one
    films, kept = views.ground.parent, folder / "kept"
    films.chmod(0o755)  # the containers' user is another one
    kept.mkdir()
    kept.chmod(0o777)
    (folder / "site.yaml").write_text(yaml.safe_dump(_site(views)), encoding="utf-8")
    mounted = [f"{films}:{_FILMS}:ro", f"{folder / 'site.yaml'}:/site/faults.yaml:ro"]
    services: dict[str, Any] = {name: {"volumes": mounted} for name in ("sync", "bestview", *CAMERAS)}
    services["bestview"] = {"volumes": [*mounted, f"{kept}:{_KEPT}"]}
    over = folder / "compose.yml"
    over.write_text(yaml.safe_dump({"services": services}), encoding="utf-8")
    with contextlib.ExitStack() as stack:
        opened = composed((*PLAIN, over), MYVIEW_CONFIG="../faults.yaml")
        site = await asyncio.to_thread(stack.enter_context, opened)
        url = f"http://{await asyncio.to_thread(site.address)}/"
        stand = FaultSite(url, folder, 0, control=site, recorded=kept)
        async with listening(stand):
            yield stand


def _site(views: StampedViews) -> dict[str, Any]:
    """Return the configuration, with the films where containers find them."""
    cameras = [
        {**it, **{key: f"{_FILMS}/{Path(it[key]).name}" for key in ("source", "detections")}}
        for it in views.cameras
    ]
    return {
        "site": views.site,
        "cameras": cameras,
        "ground": f"{_FILMS}/ground.json",
        "record": {**SETTINGS["record"], "folder": _KEPT},
    }


def _named(stand: FaultSite, name: str) -> tuple[ComposeSite, str, str]:
    """Return the site, the service and its container."""
    site: ComposeSite = stand.control
    service = stand.shown()[0] if name == SHOWN else name
    return site, service, site.container(service)


def killed(*names: str) -> Inject:
    """Kill all in containers but their init, which ends with them.

    `docker kill` would tell the engine that the container was meant to end.
    """

    async def inject(stand: FaultSite) -> None:
        for name in names:
            site, _, container = _named(stand, name)
            with contextlib.suppress(ComposeError):  # the shell that does it dies, too
                await site.docker("exec", container, "sh", "-c", "kill -KILL -1")

    return inject


def paused(name: str, seconds: float = _AWAY_S) -> Inject:
    """Stop all processes of a container for a while."""

    async def inject(stand: FaultSite) -> None:
        site, _, container = _named(stand, name)
        await site.docker("pause", container)
        try:
            await asyncio.sleep(seconds)
        finally:
            await site.docker("unpause", container)

    return inject


def restarted(name: str) -> Inject:
    """Stop a container, measure how it stops, and start it again."""

    async def inject(stand: FaultSite) -> None:
        site, service, container = _named(stand, name)
        begun = time.time()
        await site.docker("stop", "--time", f"{_GRACE_S}", container)
        state = await asyncio.to_thread(site.state, service)
        ended = datetime.fromisoformat(state["FinishedAt"]).timestamp()
        stand.ended.append(ProcessExit(service, ended - begun, state["ExitCode"]))
        await site.docker("start", container)

    return inject


def cut_off(name: str, seconds: float = _AWAY_S) -> Inject:
    """Take a container off the site's network for a while."""

    async def inject(stand: FaultSite) -> None:
        site, service, container = _named(stand, name)
        await site.docker("network", "disconnect", site.network, container)
        try:
            await asyncio.sleep(seconds)
        finally:
            await site.docker("network", "connect", "--alias", service, site.network, container)

    return inject


FAULTS = (
    Fault("kill camera", with_containers, killed(SHOWN), 10.0),
    Fault("kill sync", with_containers, killed("sync"), 10.0),
    Fault("kill sync+camera", with_containers, killed("sync", SHOWN), 10.0),
    Fault("pause camera", with_containers, paused(SHOWN), 10.0, LEASE_S + 1.0),
    Fault("pause sync", with_containers, paused("sync"), 10.0),
    Fault("pause bestview", with_containers, paused("bestview"), 10.0, None),
    Fault("restart camera", with_containers, restarted(SHOWN), 12.0),
    Fault("restart sync", with_containers, restarted("sync"), 12.0),
    Fault("cut off camera", with_containers, cut_off(SHOWN), 12.0, LEASE_S + 1.0),
    Fault("cut off sync", with_containers, cut_off("sync"), 12.0),
    Fault("cut off bestview 30 s", with_containers, cut_off("bestview", _ROUTER_AWAY_S), 45.0, None),
    Fault("kill bestview", with_containers, killed("bestview"), 30.0, None, breaks=True),
    Fault("restart bestview", with_containers, restarted("bestview"), 30.0, None, breaks=True),
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
    lacking = missing()
    if lacking is not None:
        finish(CannotRunError(lacking), "faults.containers")
    report = Report()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:  # recordings are another user's
        faults = [fault for fault in FAULTS if not chosen.fault or fault.name in chosen.fault]
        outcomes = asyncio.run(measure(faults, Path(folder), report))
    describe(report, outcomes)
    report.save(chosen.out / "faults_containers.txt")


if __name__ == "__main__":
    main()
