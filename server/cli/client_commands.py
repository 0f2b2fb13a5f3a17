"""Commands for users of a site: doctor, status, watch, delete-person and token.

Each imports its modules when it runs, so that a process loads no more than it needs.
"""

from __future__ import annotations

import asyncio
import secrets
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

import typer

from server.supervisor.shutdown import run_until_signal
from server.system.errors import UserError

_TOKEN_BYTES = 32
_AccessToken = Annotated[
    str | None,
    typer.Option(envvar="MYVIEW_TOKEN", show_envvar=True, help="Access token, if the server needs one."),
]


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
    token: _AccessToken = None,
) -> None:
    """Show a site in the terminal, live: cameras, people, viewers, recording, load; elsewhere, once."""
    from server.cli.status.command import status_live, status_once

    if once or not (as_json or sys.stdout.isatty()):
        if not asyncio.run(status_once(url, token, as_json=as_json)):
            raise typer.Exit(1)
    else:
        asyncio.run(run_until_signal(lambda: status_live(url, token, as_json=as_json)))


def watch(
    urls: Annotated[
        list[str],
        typer.Argument(
            metavar="URL…", help="The server, http://localhost:8080, and others of the same site."
        ),
    ],
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
    delay: Annotated[
        Literal["live", "balanced", "smooth"] | None,
        typer.Option("--delay", help="How much is known of what follows when a view is selected."),
    ] = None,
    token: _AccessToken = None,
) -> None:
    """List people, or watch or record a person's best view."""
    from server.cli.watch import run_watch

    asyncio.run(run_until_signal(lambda: run_watch(urls, number, out, seconds, start, end, token, delay)))


def delete_person(
    number: Annotated[int, typer.Option("--object", min=1, help="The person's number.")],
    url: Annotated[
        str, typer.Argument(metavar="[URL]", help="The server.", show_default=True)
    ] = "http://localhost:8080",
    recordings: Annotated[
        Literal["keep", "delete"] | None,
        typer.Option("--recordings", help="What to do with video and sound of when they were visible."),
    ] = None,
    run: Annotated[
        str | None,
        typer.Option("--run", help="The recorded session that the number is of, if an earlier one."),
    ] = None,
    for_good: Annotated[
        bool, typer.Option("--for-good", help="Delete; without it, print what would be deleted.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    token: _AccessToken = None,
) -> None:
    """Show what would be deleted of a person, and what others lose; delete it with --for-good."""
    from server.cli.person_deletion import run_delete_person

    asyncio.run(run_delete_person(url, number, recordings, run, token, for_good=for_good, as_json=as_json))


def token(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of its owner; not secret.")],
    operate: Annotated[
        bool, typer.Option("--operate", help="Allow operating, too, not only watching.")
    ] = False,
    number: Annotated[int | None, typer.Option("--object", min=1, help="Limit it to this person.")] = None,
    camera: Annotated[str | None, typer.Option("--camera", help="Limit it to this camera.")] = None,
    blur: Annotated[
        Literal["others", "everybody"] | None,
        typer.Option("--blur", help="Pixelate everybody but the person who is watched, or everybody."),
    ] = None,
) -> None:
    """Print a new token, and the line for the token file."""
    import yaml
    from pydantic import ValidationError

    from server.config.tokens_file import Token, secret_digest

    secret = secrets.token_urlsafe(_TOKEN_BYTES)
    line = {"name": name, "sha256": secret_digest(secret), "role": "operate" if operate else "watch"}
    limits = {"object": number, "camera": camera, "blur": blur}
    made = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    content = {**line, **{key: value for key, value in limits.items() if value is not None}, "made": made}
    try:
        Token.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        reason = first["msg"].removeprefix("Value error, ")
        raise UserError(f"token: {f'{place}: ' if place else ''}{reason}") from error
    entry = yaml.safe_dump(content, default_flow_style=True, sort_keys=False, width=1000, allow_unicode=True)
    typer.echo(f"the token, which is stored nowhere:\n  {secret}\n")
    typer.echo("its line for the token file (access.tokens), below 'tokens:'")
    typer.echo(f"  - {entry.strip()}")
