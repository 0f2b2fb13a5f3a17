"""``myview watch``: list people, or watch or record a person's best view."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from client import AwayError as ServerAway
from client import ClientError, HttpSettings, Progress, elsewhere, objects, watch
from server.system.atomic_write import check_output_file
from server.system.errors import UnavailableError, UserError, reason_of

_PRINT_EVERY_S = 1.0


async def run_watch(
    urls: Sequence[str],
    number: int | None,
    out: Path | None,
    seconds: float | None,
    start: str | None = None,
    end: str | None = None,
    token: str | None = None,
    delay: str | None = None,
) -> None:
    """List people, or watch one person, on the first of the site's servers that answers.

    Raises:
        UnavailableError: the server cannot be reached.
        UserError: there is no such person, or the file cannot be written.
    """
    if number is None and (out or seconds is not None or start or end):
        raise UserError("watch: --out, --seconds, --from and --to need --object")
    if delay is not None and (number is None or start or end):
        raise UserError("watch: --delay needs --object, and is not for the past")
    if out is not None:
        check_output_file(out)
    url, *others = urls
    settings, before = HttpSettings(token=token, others=tuple(others)), _file_at(out)
    try:
        if number is None:
            await _list(url, settings)
            return
        watched = await watch(
            url,
            number,
            out,
            seconds,
            _ProgressPrinter(),
            start=start,
            end=end,
            delay=delay,
            settings=settings,
        )
    except ServerAway as error:
        raise UnavailableError(f"watch: {error}") from error
    except (ClientError, ValueError) as error:
        raise UserError(f"watch: {error}") from error
    except OSError as error:
        suffix = "; the recording up to then is kept" if _file_at(out) != before else ""
        raise UserError(f"{out}: cannot write there: {reason_of(error)}{suffix}") from error
    where = f" in {', '.join(map(str, [out, *watched.more_files]))}" if out else ""
    typer.echo(f"object {number}: {watched.seconds:.1f} s, {watched.cuts} cuts{where}")
    if not watched.complete:
        raise UnavailableError("watch: the server disconnected before the end")


def _file_at(out: Path | None) -> int | None:
    """Return a file's inode number; None: it does not exist."""
    return out.stat().st_ino if out is not None and out.exists() else None


async def _list(url: str, settings: HttpSettings) -> None:
    table = Table("object", "visible", "shown by", "seen by", box=None)
    for person in await objects(url, settings):
        label = escape(f"{person.object} {person.name}") if person.name else str(person.object)
        visible = "yes" if person.visible else "no"
        table.add_row(label, visible, person.camera or "-", " ".join(person.cameras))
    for other in await elsewhere(url, settings):
        if other.visible is not None:
            place = "another area" if other.site is None else f"site {other.site}"
            table.add_row(str(other.object), "yes" if other.visible else "no", place, "")
    Console().print(table)


class _ProgressPrinter:
    """Prints progress to standard error once a second."""

    def __init__(self) -> None:
        self._printed = 0.0

    def __call__(self, progress: Progress) -> None:
        now = time.monotonic()
        if now - self._printed >= _PRINT_EVERY_S:
            self._printed = now
            typer.echo(
                f"{progress.seconds:6.1f} s  {progress.bytes / 1e6:6.2f} MB  "
                f"camera {progress.camera or '-'}  {progress.cuts} cuts",
                err=True,
            )
