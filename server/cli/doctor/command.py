"""``myview doctor``: checks a configuration against cameras, network and machine before the site starts."""

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
from server.supervisor.synthetic_homographies import add_synthetic_homographies
from server.system.descriptors import descriptor_limit
from server.system.errors import UserError

T = TypeVar("T")

_LONGEST = "record.max_mb"
"""The longest name of a check without a camera's name."""
_REMEDY = "fix the configuration; configs/demo.yaml explains every setting"


def run_doctor(path: Path, seconds: float, *, as_json: bool) -> bool:
    """Check a configuration and print findings as they come; return whether none is bad."""
    return asyncio.run(_check_and_report(path, seconds, as_json=as_json)).ok


async def _check_and_report(path: Path, seconds: float, *, as_json: bool) -> Findings:
    findings: list[Finding] = []
    config = _read(path, findings)
    names = [] if config is None else [f"camera {camera}" for camera in config.camera_ids]
    width, console = max(map(len, [_LONGEST, *names])), Console()

    def report(finding: Finding) -> None:
        if not as_json:
            show(finding, width, console)

    for finding in findings:
        report(finding)
    if config is not None:
        async for finding in run_checks(config, seconds):
            findings.append(finding)
            report(finding)
    summary = collect_findings(findings)
    if as_json:
        typer.echo(msgspec.json.format(msgspec.json.encode(summary)).decode())
    else:
        show_counts(summary, console)
    return summary


def _read(path: Path, findings: list[Finding]) -> Config | None:
    with report_failure("configuration", findings):
        try:
            config = load_config(path)
        except UserError as error:
            findings.append(bad("configuration", str(error), _REMEDY))
            return None
        site = config.site
        summary = f"{len(config.cameras)} cameras, {site.width}x{site.height} at {site.fps:g} a second"
        findings.append(ok("configuration", f"{path}: {summary}"))
        return config
    return None


async def run_checks(config: Config, seconds: float) -> AsyncIterator[Finding]:
    """Yield all findings about a configuration as soon as they are known."""
    findings: list[Finding] = []
    runs, probes = False, {camera: CameraProbe("not tried") for camera in config.camera_ids}
    with report_failure("ports", findings):
        ports, runs = await port_findings(config)
        findings += ports
    with report_failure("zenoh.connect", findings):
        findings += await reachability_findings(config)
    for finding in [*findings, *file_findings(_with_scene_ground(config))]:
        yield finding
    findings = []
    with report_failure("clock", findings):
        findings += await clock_findings(config)
    for finding in findings:
        yield finding
    findings = []
    with report_failure("cameras", findings):
        probes = await _run_detached(lambda: probe_cameras(config, seconds))
    for finding in findings + _camera_dependent_findings(config, probes, runs=runs):
        yield finding


async def _run_detached(work: Callable[[], T]) -> T:
    """Run work in a daemon thread, abandoned on cancellation, since it may hang in a driver."""
    loop = asyncio.get_running_loop()
    result: asyncio.Future[T] = loop.create_future()

    def run() -> None:
        try:
            value = work()
        except Exception as error:  # noqa: BLE001 — passed to the caller
            done = partial(result.set_exception, error)
        else:
            done = partial(result.set_result, value)
        with contextlib.suppress(RuntimeError):  # the loop may be closed
            loop.call_soon_threadsafe(lambda: None if result.cancelled() else done())

    threading.Thread(target=run, daemon=True).start()
    return await result


def _camera_dependent_findings(
    config: Config, probes: dict[str, CameraProbe], *, runs: bool
) -> list[Finding]:
    """Return the findings that need the cameras' probes."""
    checks: Sequence[tuple[str, Callable[[], list[Finding]]]] = (
        ("cameras", lambda: camera_findings(config, probes, runs=runs)),
        ("sound", lambda: sound_findings(config)),
        ("disk", lambda: disk_findings(config, probes)),
        ("machine", lambda: machine_findings(config, probes)),
        ("open files", lambda: descriptor_findings(config, descriptor_limit())),
    )
    findings: list[Finding] = []
    for check, find in checks:
        with report_failure(check, findings):
            findings += find()
    return findings


def _with_scene_ground(config: Config) -> Config:
    """Return the configuration with its scenes' homographies; the cameras report unknown scenes."""
    try:
        return add_synthetic_homographies(config)
    except (UserError, OSError):
        return config
