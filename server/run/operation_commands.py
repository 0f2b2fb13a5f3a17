"""The commands that look at a site: before it runs, and while it does.

Each imports what it runs only when it runs, so that a process loads no more than it needs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def doctor(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="The site's configuration, a YAML file.")],
    seconds: Annotated[float, typer.Option(min=1, max=60, help="How long each camera is tried.")] = 10.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print an object of JSON instead.")] = False,
) -> None:
    """Check a configuration against reality: cameras, ports, clock, disk, certificates, machine."""
    from server.run.doctor import run_doctor

    if not run_doctor(config, seconds, as_json=as_json):
        raise typer.Exit(1)
