"""The commands that look at a site: before it runs, and while it does.

Each imports what it runs only when it runs, so that a process loads no more than it needs.
"""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import Annotated

import typer

from server.supervisor.shutdown import run_until_signal


def doctor(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="The site's configuration, a YAML file.")],
    seconds: Annotated[float, typer.Option(min=1, max=60, help="Seconds to try each camera.")] = 10.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Check a configuration against reality: cameras, ports, clock, disk, certificates, machine."""
    from server.cli.doctor.command import run_doctor

    if not run_doctor(config, seconds, as_json=as_json):
        raise typer.Exit(1)


def status(
    url: Annotated[
        str, typer.Argument(metavar="[URL]", help="The server.", show_default=True)
    ] = "http://localhost:8080",
    once: Annotated[
        bool, typer.Option("--once", help="Print once; exit code 1 if the site is not ready.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, one object per line.")] = False,
    token: Annotated[
        str | None,
        typer.Option(envvar="MYVIEW_TOKEN", show_envvar=True, help="Access token, if the server needs one."),
    ] = None,
) -> None:
    """Show a site in the terminal, live: cameras, people, viewers, recording, load; elsewhere, once."""
    from server.cli.status.command import status_live, status_once

    if once or not (as_json or sys.stdout.isatty()):
        if not asyncio.run(status_once(url, token, as_json=as_json)):
            raise typer.Exit(1)
    else:
        asyncio.run(run_until_signal(lambda: status_live(url, token, as_json=as_json)))
