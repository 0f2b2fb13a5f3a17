"""What the doctor finds: one line for each check, how bad it is, and what to do."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

import msgspec
from rich.console import Console
from rich.markup import escape

from server.run.printable import printable


class Level(Enum):
    """How bad it is."""

    OK = "ok"
    WARNING = "warning"
    """The site runs, but not as it should."""
    BAD = "bad"
    """The site does not start, or a part of it is missing."""


class Finding(msgspec.Struct, frozen=True):
    """What one check found."""

    check: str
    level: Level
    text: str
    do: str = ""
    """What to do about it; empty where nothing is to be done."""


class Findings(msgspec.Struct, frozen=True):
    """All of it: what ``--json`` prints."""

    well: bool
    """Nothing is bad."""
    findings: list[Finding]


def ok(check: str, text: str) -> Finding:
    """Say that something is as it should be."""
    return Finding(check, Level.OK, text)


def warning(check: str, text: str, do: str) -> Finding:
    """Say that something should be looked at."""
    return Finding(check, Level.WARNING, text, do)


def bad(check: str, text: str, do: str = "") -> Finding:
    """Say that something does not work."""
    return Finding(check, Level.BAD, text, do)


def all_of(findings: Sequence[Finding]) -> Findings:
    """Put findings together."""
    return Findings(all(it.level is not Level.BAD for it in findings), list(findings))


_COLOURS = {Level.OK: "green", Level.WARNING: "yellow", Level.BAD: "red"}


def show(findings: Findings, console: Console) -> None:
    """Print a line for each finding, with what to do behind an arrow."""
    width = max((len(it.check) for it in findings.findings), default=0)
    for it in findings.findings:
        colour = _COLOURS[it.level]
        do = f" → {it.do}" if it.do else ""
        head = f"[{colour}]{it.level.value:7}[/{colour}] {escape(f'{it.check:{width}}')}"
        console.print(f"{head}  {escape(printable(f'{it.text}{do}'))}", soft_wrap=True, highlight=False)
    counts = {level: sum(it.level is level for it in findings.findings) for level in Level}
    console.print(", ".join(f"{count} {level.value}" for level, count in counts.items()), highlight=False)
