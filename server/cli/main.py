"""The command line: one entry point, exit code 0, or one line that says what is wrong and another code."""

from __future__ import annotations

import atexit
import errno
import gc
import os
import signal
import sys
from importlib.metadata import version as version_of
from typing import Annotated

import typer

from server.cli import file_commands, operation_commands, site_commands, token_commands, viewer_commands
from server.cli.calibrate.command import calibrate
from server.supervisor.shutdown import SUPERVISED_VARIABLE
from server.system.address_redaction import redact_address
from server.system.child_process import terminate_with_parent
from server.system.descriptors import raise_descriptor_limit
from server.system.errors import UserError
from server.system.log_setup import say_failure

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
    site_commands.up,
    site_commands.sync,
    site_commands.camera,
    site_commands.bestview,
    file_commands.render,
    file_commands.track,
    file_commands.evaluate,
    file_commands.scene,
    calibrate,
    viewer_commands.watch,
    operation_commands.doctor,
    operation_commands.status,
    token_commands.token,
):
    app.command()(run)

_BAD_INPUT = UserError.code
_INTERRUPTED = 130
_PATH_ERRORS = {errno.EACCES, errno.EPERM, errno.ENAMETOOLONG, errno.ELOOP}
_TERMINATED = 143
_sigterms: list[int] = []
"""SIGTERM, once it was received."""


def _on_sigterm(number: int, _: object) -> None:
    _sigterms.append(number)
    sys.exit(_TERMINATED)


def _was_cut_short(error: BaseException | None) -> bool:
    """Return whether an error was caused by a call that a signal interrupted."""
    while error is not None:
        if isinstance(error, OSError) and error.errno == errno.EINTR:
            return True
        error = error.__cause__ or error.__context__
    return False


def main() -> None:
    """Run the command line; no traceback for bad input."""
    # Collecting cycles of a thousand modules at exit takes half a second, for nothing.
    atexit.register(gc.freeze)
    raise_descriptor_limit()
    if os.environ.get(SUPERVISED_VARIABLE):
        terminate_with_parent()
    # Signals raise, so that half-written files are removed. Services write nothing before they have their own
    # handlers, and until then end at once.
    if signal.getsignal(signal.SIGINT) == signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGTERM) == signal.SIG_DFL:
        signal.signal(signal.SIGTERM, _on_sigterm)
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(_INTERRUPTED)
    except Exception as error:  # noqa: BLE001 — printed, or raised again
        if _was_cut_short(error):
            sys.exit(_TERMINATED if _sigterms else _INTERRUPTED)
        _fail(error)


def _fail(error: Exception) -> None:
    """Print a one-line error and exit; raise again what is a bug."""
    if isinstance(error, UserError):
        say_failure(str(error))
        sys.exit(error.code)
    if isinstance(error, BrokenPipeError):  # the reader of our output has gone, as in `… | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    if isinstance(error, OSError) and error.filename is not None and error.errno in _PATH_ERRORS:
        # A path that cannot be followed, wherever it is used first.
        say_failure(f"{redact_address(str(error.filename))}: {error.strerror}")
        sys.exit(_BAD_INPUT)
    raise error


if __name__ == "__main__":
    main()
