"""The commands that watch a site over HTTP.

Each imports what it runs only when it runs, so that a process loads no more than it needs.
"""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated

import typer

from server.supervisor.shutdown import run_until_signal


def watch(
    url: Annotated[str, typer.Argument(metavar="URL", help="The server, e.g. http://localhost:8080")],
    number: Annotated[
        int | None, typer.Option("--object", help="Whose best view to watch; without it, people are listed.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="The file to record into.")] = None,
    seconds: Annotated[float | None, typer.Option(min=0, help="Stop recording after this long.")] = None,
    start: Annotated[
        str | None,
        typer.Option("--from", help="Start: -60 (seconds back), p1250 (a pulse) or a time (ISO 8601)."),
    ] = None,
    end: Annotated[str | None, typer.Option("--to", help="End, likewise.")] = None,
    token: Annotated[
        str | None,
        typer.Option(envvar="MYVIEW_TOKEN", show_envvar=True, help="Access token, if the server needs one."),
    ] = None,
) -> None:
    """List people, or watch or record a person's best view."""
    from server.cli.watch import run_watch

    asyncio.run(run_until_signal(lambda: run_watch(url, number, out, seconds, start, end, token)))
