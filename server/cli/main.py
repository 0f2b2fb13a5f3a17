"""Entry point of the command line: runs a command; errors are one line and an exit code."""

from __future__ import annotations

import atexit
import errno
import gc
import os
import signal
import sys
from importlib.metadata import version as version_of
from typing import Annotated, NoReturn

import typer

from server.cli import client_commands, file_commands, site_commands
from server.cli.areas import areas
from server.cli.calibrate.command import calibrate
from server.cli.models.command import app as models_app
from server.supervisor.shutdown import SUPERVISED_VARIABLE
from server.supervisor.startup_signal import report_refusal
from server.system.address_redaction import located_reason_of
from server.system.child_process import terminate_with_parent
from server.system.descriptors import raise_descriptor_limit
from server.system.errors import UserError
from server.system.log_setup import report_error

app = typer.Typer(
    help="MyView: pick a person; see them, live, from whichever camera sees them best.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"myview {version_of('myview')}")
        raise typer.Exit


@app.callback()
def _myview(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True),
    ] = False,
) -> None:
    """Accept the options that precede a command."""


for run in (
    site_commands.demo,
    site_commands.init,
    site_commands.up,
    site_commands.sync,
    site_commands.camera,
    site_commands.bestview,
    site_commands.rtsp,
    file_commands.render,
    file_commands.track,
    file_commands.evaluate,
    file_commands.scene,
    calibrate,
    areas,
    client_commands.watch,
    client_commands.doctor,
    client_commands.status,
    client_commands.delete_person,
    client_commands.token,
):
    app.command()(run)
app.add_typer(models_app, name="models")

_BAD_INPUT = UserError.code
_INTERRUPTED = 130
_PATH_ERRORS = {errno.EACCES, errno.EPERM, errno.ENAMETOOLONG, errno.ELOOP}
_TERMINATED = 143
_sigterms: list[int] = []
"""SIGTERM, if it was received."""


def _on_sigterm(number: int, _: object) -> None:
    _sigterms.append(number)
    sys.exit(_TERMINATED)


def _was_interrupted(error: BaseException | None) -> bool:
    """Return whether an error was caused by a call that a signal interrupted."""
    while error is not None:
        if isinstance(error, OSError) and error.errno == errno.EINTR:
            return True
        error = error.__cause__ or error.__context__
    return False


def main() -> None:
    """Run the command line; bad input causes no traceback."""
    # Garbage collection of a thousand modules at exit would take half a second.
    atexit.register(gc.freeze)
    raise_descriptor_limit()
    if os.environ.get(SUPERVISED_VARIABLE):
        terminate_with_parent()
    # Signals raise exceptions, so that half-written files are removed. Services exit at once until they have
    # their own handlers, since they have written nothing before.
    if signal.getsignal(signal.SIGINT) == signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGTERM) == signal.SIG_DFL:
        signal.signal(signal.SIGTERM, _on_sigterm)
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(_INTERRUPTED)
    except Exception as error:  # noqa: BLE001 — printed, or raised again
        if _was_interrupted(error):
            sys.exit(_TERMINATED if _sigterms else _INTERRUPTED)
        _fail(error)


def _fail(error: Exception) -> None:
    """Print a one-line error and exit; re-raise bugs."""
    if isinstance(error, UserError):
        _refuse(str(error), error.code)
    if isinstance(error, BrokenPipeError):  # the reader of the output has exited, as in `… | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    if isinstance(error, OSError) and error.filename is not None and error.errno in _PATH_ERRORS:
        # An inaccessible path.
        _refuse(located_reason_of(error), _BAD_INPUT)
    raise error


def _refuse(reason: str, code: int) -> NoReturn:
    report_error(reason)
    report_refusal(reason)
    sys.exit(code)


if __name__ == "__main__":
    main()
