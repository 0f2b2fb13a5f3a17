"""Runs `myview` in the process of the tests."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest

from server.cli.main import main

BAD_INPUT = 2


class CommandResult(NamedTuple):
    """The exit code and output of a command."""

    code: int
    out: str
    err: str


def input_error(ended: CommandResult) -> str:
    """Return the single error line about the input."""
    assert (ended.code, ended.out) == (BAD_INPUT, ""), ended.err
    (line,) = ended.err.splitlines()
    assert line.startswith("myview: ")
    return line


RunCommand = Callable[..., CommandResult]


@pytest.fixture
def myview(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[RunCommand]:
    """Yield a function that runs `myview` with some arguments."""
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}

    def command(*arguments: object) -> CommandResult:
        monkeypatch.setattr(sys, "argv", ["myview", *map(str, arguments)])
        capsys.readouterr()
        code = 0
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
        output = capsys.readouterr()
        return CommandResult(code, output.out, output.err)

    yield command
    for number, handler in before.items():
        signal.signal(number, handler)
