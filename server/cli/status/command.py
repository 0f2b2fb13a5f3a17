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
from server.cli.status.display import ServiceRates, render_status
from server.system.errors import UnavailableError, UserError
from server.system.printable import printable

_EVERY_S = 1.0


@dataclass(frozen=True, slots=True)
class SiteReport:
    """The status of a site at one time, or why it is unknown."""

    now: SiteNow | None
    away: str = ""
    """Why the server cannot be reached."""


async def status_once(url: str, token: str | None, *, as_json: bool) -> bool:
    """Print a site's status; return whether it is ready.

    Raises:
        UserError: the server refuses the request, or is not a MyView server.
        UnavailableError: it cannot be reached.
    """
    report = await _report(url, HttpSettings(token=token))
    if report.now is None:
        raise UnavailableError(f"status: {report.away}")
    if as_json:
        typer.echo(msgspec.json.encode(report.now))
    else:
        Console().print(render_status(report.now, ServiceRates()))
    return report.now.ready


async def status_live(url: str, token: str | None, *, as_json: bool) -> None:
    """Show a site's status until cancelled; an unreachable server is retried.

    Raises:
        UserError: the server refuses the request, or is not a MyView server.
    """
    reports = _reports(url, HttpSettings(token=token, connect_timeout=2.0, read_timeout=5.0))
    if as_json:
        async for report in reports:
            typer.echo(msgspec.json.encode(report.now if report.now is not None else {"away": report.away}))
        return
    before: SiteNow | None = None
    restarted = ""
    with Live(Text("connecting to the server"), auto_refresh=False, console=Console()) as live:
        async for report in reports:
            if report.now is None:
                notice = f"{report.away}; trying again"
                shown = (
                    Text(printable(notice), style="red")
                    if before is None
                    else render_status(before, ServiceRates(), notice)
                )
            else:
                if before is not None and _is_another_run(before, report.now):
                    restarted = "the service was restarted"
                shown = render_status(report.now, ServiceRates.between(before, report.now), restarted)
                before = report.now
            live.update(shown, refresh=True)


async def _reports(url: str, settings: HttpSettings) -> AsyncIterator[SiteReport]:
    while True:
        yield await _report(url, settings)
        await asyncio.sleep(_EVERY_S)


async def _report(url: str, settings: HttpSettings) -> SiteReport:
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
