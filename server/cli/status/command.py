"""``myview status``: a site in the terminal, live, or once for a script."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass

import msgspec
import typer
from rich.console import Console
from rich.live import Live
from rich.text import Text

from client import AwayError as ServerAway
from client import ClientError, HttpSettings, RefusedError, SiteNow, status
from server.cli.status.display import Rates, render_status
from server.system.errors import UnavailableError, UserError
from server.system.printable import printable

_EVERY_S = 1.0


@dataclass(frozen=True, slots=True)
class SiteReport:
    """One look at a site: how it is, or why nobody can tell."""

    now: SiteNow | None
    away: str = ""


async def status_once(url: str, token: str | None, *, as_json: bool) -> bool:
    """Print how a site is; return whether it is ready.

    Raises:
        UserError: the server refuses, or is none.
        UnavailableError: it cannot be reached.
    """
    look = await _look(url, HttpSettings(token=token))
    if look.now is None:
        raise UnavailableError(f"status: {look.away}")
    if as_json:
        typer.echo(msgspec.json.encode(look.now))
    else:
        Console().print(render_status(look.now, Rates()))
    return look.now.ready


async def status_live(url: str, token: str | None, *, as_json: bool) -> None:
    """Show how a site is until told to end; a server that goes away is waited for.

    Raises:
        UserError: the server refuses, or is none.
    """
    looks = _looks(url, HttpSettings(token=token, connect_timeout=2.0, read_timeout=5.0))
    if as_json:
        async for look in looks:
            typer.echo(msgspec.json.encode(look.now if look.now is not None else {"away": look.away}))
        return
    before: SiteNow | None = None
    restarted = ""
    with Live(Text("asking the server"), auto_refresh=False, console=Console()) as live:
        async for look in looks:
            if look.now is None:
                notice = f"{look.away}; trying again"
                shown = (
                    Text(printable(notice), style="red")
                    if before is None
                    else render_status(before, Rates(), notice)
                )
            else:
                if before is not None and _is_another_run(before, look.now):
                    restarted = "the service was restarted"
                shown = render_status(look.now, Rates.between(before, look.now), restarted)
                before = look.now
            live.update(shown, refresh=True)


async def _looks(url: str, settings: HttpSettings) -> AsyncIterator[SiteReport]:
    while True:
        yield await _look(url, settings)
        await asyncio.sleep(_EVERY_S)


async def _look(url: str, settings: HttpSettings) -> SiteReport:
    try:
        return SiteReport(await status(url, settings))
    except ServerAway as error:
        return SiteReport(None, str(error))
    except RefusedError as error:
        raise UserError(f"status: {error}; --token, or MYVIEW_TOKEN") from error
    except (ClientError, ValueError) as error:
        raise UserError(f"status: {error}") from error


def _is_another_run(before: SiteNow, after: SiteNow) -> bool:
    one, other = before.service, after.service
    return one is not None and other is not None and one.began != other.began
