"""The commands for who operates a site."""

from __future__ import annotations

import secrets

import typer

_BYTES = 32


def operator_token() -> None:
    """Print a new token to operate a site with, and the configuration's line that lets it in."""
    from server.web.operator_permission import digest_of

    token = secrets.token_urlsafe(_BYTES)
    typer.echo(f"the token, for whoever operates:\n  {token}\n")
    typer.echo(
        f'for the configuration, which knows only its SHA-256:\nhttp:\n  operator_token: "{digest_of(token)}"'
    )
