"""The set-up page of ``myview up``: served until the configuration is written, then the site starts."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import typer

from server.config.sections import HttpSettings
from server.http.setup_app import serve_setup
from server.setup.session import SetupSession
from server.system.errors import UserError

_PORT_VARIABLE = "MYVIEW_HTTP__PORT"


def set_up_in_page(path: Path, port: int | None) -> int | None:
    """Let the user of this machine set a site up in a browser; return the port on which it then starts.

    Raises:
        UserError: the folder does not exist, or the port is in use.
    """
    if not path.parent.is_dir():
        raise UserError(f"{path.parent}: no such folder")
    text = os.environ.get(_PORT_VARIABLE, str(HttpSettings().port)) if port is None else str(port)
    if not text.isdecimal():
        raise UserError(f"environment: {_PORT_VARIABLE}: is not a port")
    used = asyncio.run(serve_setup(SetupSession(path), int(text), lambda url: _announce(url, path)))
    return used if port is not None else None


def _announce(url: str, path: Path) -> None:
    typer.echo(f"Set the site up in a browser on this machine; it is written to {path}:\n\n  {url}\n")
