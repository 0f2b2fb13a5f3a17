"""The configuration file, as an operator's requests change it: one at a time."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from aiohttp import web

from server.http.app_keys import CONTROL
from server.system.errors import UserError

_T = TypeVar("_T")
_CHANGING = threading.Lock()


def config_path(request: web.Request) -> Path:
    """Return the configuration file of the site.

    Raises:
        UserError: there is none.
    """
    path = request.app[CONTROL].path
    if path is None:
        raise UserError("this service has no configuration file")
    return path


async def change_config(path: Path, change: Callable[[Path], _T]) -> _T:
    """Change the file in a thread, while nothing else changes it; return what the change returns.

    Raises:
        UserError: the change is refused, or the file cannot be written.
    """

    def run() -> _T:
        with _CHANGING:
            return change(path)

    return await asyncio.to_thread(run)
