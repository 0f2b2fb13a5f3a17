"""``myview doctor``: a configuration against reality, before it is needed at night."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import AsyncIterator, Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

import msgspec
import typer
from rich.console import Console

from server.cli.doctor.camera_probe import CameraProbe
from server.cli.doctor.cameras import camera_findings, probe_cameras, sound_findings
from server.cli.doctor.disk import disk_findings
from server.cli.doctor.files import file_findings
from server.cli.doctor.findings import (
    Finding,
    Findings,
    bad,
    collect_findings,
    ok,
    report_failure,
    show,
    show_counts,
)
from server.cli.doctor.machine import clock_findings, descriptor_findings, machine_findings
from server.cli.doctor.ports import port_findings
from server.cli.doctor.reachability import reachability_findings
from server.config.loader import load_config
from server.config.site_config import Config
from server.supervisor.scene_ground import add_scene_ground
from server.system.descriptors import descriptor_limit
from server.system.errors import UserError

T = TypeVar("T")

_LONGEST = "record.max_mb"
"""The longest name of a check, but for those that have a camera's in it."""
_MEND = "mend it there; configs/demo.yaml explains every setting"


def run_doctor(path: Path, seconds: float, *, as_json: bool) -> bool:
    """Check a configuration, print what is found as it is found; return whether nothing is bad."""
    return asyncio.run(_told(path, seconds, as_json=as_json)).well


async def _told(path: Path, seconds: float, *, as_json: bool) -> Findings:
    found: list[Finding] = []
    config = _read(path, found)
    names = [] if config is None else [f"camera {it}" for it in config.camera_ids]
    width, console = max(map(len, [_LONGEST, *names])), Console()

    def tell(it: Finding) -> None:
        if not as_json:
            show(it, width, console)

    for it in found:
        tell(it)
    if config is not None:
        async for it in run_checks(config, seconds):
            found.append(it)
            tell(it)
    findings = collect_findings(found)
    if as_json:
        typer.echo(msgspec.json.format(msgspec.json.encode(findings)).decode())
    else:
        show_counts(findings, console)
    return findings


def _read(path: Path, found: list[Finding]) -> Config | None:
    with report_failure("configuration", found):
        try:
            config = load_config(path)
        except UserError as error:
            found.append(bad("configuration", str(error), _MEND))
            return None
        site = config.site
        what = f"{len(config.cameras)} cameras, {site.width}x{site.height} at {site.fps:g} a second"
        found.append(ok("configuration", f"{path}: {what}"))
        return config
    return None


async def run_checks(config: Config, seconds: float) -> AsyncIterator[Finding]:
    """Return all findings about a configuration, as they are found."""
    found: list[Finding] = []
    runs, probes = False, {it: CameraProbe("it was not tried") for it in config.camera_ids}
    with report_failure("ports", found):
        ports, runs = await port_findings(config)
        found += ports
    with report_failure("zenoh.connect", found):
        found += await reachability_findings(config)
    for it in [*found, *file_findings(_placed(config))]:
        yield it
    found = []
    with report_failure("clock", found):
        found += await clock_findings(config)
    for it in found:
        yield it
    found = []
    with report_failure("cameras", found):
        probes = await _let_go_of(lambda: probe_cameras(config, seconds))
    for it in found + _last(config, probes, runs=runs):
        yield it


async def _let_go_of(work: Callable[[], T]) -> T:
    """Run in a thread that nobody waits for where the doctor is told to end: it may hang in a driver."""
    loop = asyncio.get_running_loop()
    result: asyncio.Future[T] = loop.create_future()

    def run() -> None:
        try:
            value = work()
        except Exception as error:  # noqa: BLE001 — goes to whoever waits
            done = partial(result.set_exception, error)
        else:
            done = partial(result.set_result, value)
        with contextlib.suppress(RuntimeError):  # the loop may be over
            loop.call_soon_threadsafe(lambda: None if result.cancelled() else done())

    threading.Thread(target=run, daemon=True).start()
    return await result


def _last(config: Config, probes: dict[str, CameraProbe], *, runs: bool) -> list[Finding]:
    """Return the findings that are known once the cameras were tried."""
    checks: Sequence[tuple[str, Callable[[], list[Finding]]]] = (
        ("cameras", lambda: camera_findings(config, probes, runs=runs)),
        ("sound", lambda: sound_findings(config)),
        ("disk", lambda: disk_findings(config, probes)),
        ("machine", lambda: machine_findings(config, probes)),
        ("open files", lambda: descriptor_findings(config, descriptor_limit())),
    )
    found: list[Finding] = []
    for check, find in checks:
        with report_failure(check, found):
            found += find()
    return found


def _placed(config: Config) -> Config:
    """Return the configuration with its scenes' floors; where there is no such scene, the camera says so."""
    try:
        return add_scene_ground(config)
    except (UserError, OSError):
        return config
