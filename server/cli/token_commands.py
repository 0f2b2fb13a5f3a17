"""The command ``token``."""

from __future__ import annotations

import secrets
from datetime import UTC, datetime
from typing import Annotated

import typer

from server.system.errors import UserError

_BYTES = 32


def token(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of its owner; not secret.")],
    operate: Annotated[
        bool, typer.Option("--operate", help="Allow operating, too, not only watching.")
    ] = False,
    number: Annotated[int | None, typer.Option("--object", min=1, help="Limit it to this person.")] = None,
    camera: Annotated[str | None, typer.Option("--camera", help="Limit it to this camera.")] = None,
) -> None:
    """Print a new token, once, and the line that lets it in."""
    import yaml
    from pydantic import ValidationError

    from server.config.tokens_file import Token, token_digest

    given = secrets.token_urlsafe(_BYTES)
    line = {"name": name, "sha256": token_digest(given), "role": "operate" if operate else "watch"}
    limits = {"object": number, "camera": camera}
    made = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    content = {**line, **{key: it for key, it in limits.items() if it is not None}, "made": made}
    try:
        Token.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        reason = first["msg"].removeprefix("Value error, ")
        raise UserError(f"token: {f'{place}: ' if place else ''}{reason}") from error
    written = yaml.safe_dump(
        content, default_flow_style=True, sort_keys=False, width=1000, allow_unicode=True
    )
    typer.echo(f"the token, which is stored nowhere:\n  {given}\n")
    typer.echo("its line for the token file (access.tokens), below 'tokens:'")
    typer.echo(f"  - {written.strip()}")
