"""``myview doctor``: a configuration against reality, before it is needed at night."""

from __future__ import annotations

import asyncio
from pathlib import Path

import msgspec
import typer
from rich.console import Console

from server.run.doctor_cameras import camera_findings, probe_all, sound_findings
from server.run.doctor_disk import disk_findings
from server.run.doctor_files import file_findings
from server.run.doctor_findings import Finding, Findings, all_of, bad, ok, show
from server.run.doctor_machine import clock_findings, machine_findings
from server.run.doctor_ports import port_findings
from server.run.scene_ground import with_scene_ground
from server.wire.config import Config
from server.wire.errors import UserError
from server.wire.loading import load_config


def run_doctor(path: Path, seconds: float, *, as_json: bool) -> bool:
    """Check a configuration, print what was found; tell whether nothing is bad."""
    findings = all_of(asyncio.run(_checked(path, seconds)))
    _tell(findings, as_json=as_json)
    return findings.well


async def _checked(path: Path, seconds: float) -> list[Finding]:
    try:
        config = load_config(path)
    except UserError as error:
        return [bad("configuration", str(error).removeprefix(f"{path}: "))]
    site = config.site
    head = ok(
        "configuration",
        f"{path}: {len(config.cameras)} cameras, {site.width}x{site.height} at {site.fps:g} a second",
    )
    ports, runs = await port_findings(config)
    clock = await clock_findings(config)
    probes = await asyncio.to_thread(probe_all, config, seconds)
    return [
        head,
        *ports,
        *file_findings(_placed(config)),
        *clock,
        *camera_findings(config, probes, runs=runs),
        *sound_findings(config),
        *disk_findings(config, probes),
        *machine_findings(config, probes),
    ]


def _placed(config: Config) -> Config:
    """Give the configuration with its scenes' floors; where there is no such scene, the camera says so."""
    try:
        return with_scene_ground(config)
    except UserError:
        return config


def _tell(findings: Findings, *, as_json: bool) -> None:
    if as_json:
        typer.echo(msgspec.json.format(msgspec.json.encode(findings)).decode())
    else:
        show(findings, Console())
