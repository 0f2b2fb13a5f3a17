"""Findings of the doctor: a line per check, with its level and remedy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import Enum

import msgspec
from rich.console import Console
from rich.markup import escape

from server.system.address_redaction import redact_address, redact_addresses
from server.system.errors import UserError
from server.system.printable import printable


class Level(Enum):
    """The severity of a finding."""

    OK = "ok"
    WARNING = "warning"
    """The site runs, but not as it should."""
    BAD = "bad"
    """The site does not start, or a part of it is missing."""


class Finding(msgspec.Struct, frozen=True):
    """The result of one check."""

    check: str
    level: Level
    text: str
    do: str = ""
    """The remedy; empty where none is needed."""


class Findings(msgspec.Struct, frozen=True):
    """All findings, as ``--json`` prints them."""

    well: bool
    """Nothing is bad."""
    findings: list[Finding]


def ok(check: str, text: str) -> Finding:
    """Build a finding for a check that passed."""
    return Finding(check, Level.OK, text)


def warning(check: str, text: str, do: str) -> Finding:
    """Build a finding for something that should be looked at."""
    return Finding(check, Level.WARNING, text, do)


def bad(check: str, text: str, do: str = "") -> Finding:
    """Build a finding for something that does not work."""
    return Finding(check, Level.BAD, text, do)


def collect_findings(findings: Sequence[Finding]) -> Findings:
    """Put findings together."""
    return Findings(all(it.level is not Level.BAD for it in findings), list(findings))


@contextmanager
def report_failure(check: str, findings: list[Finding]) -> Iterator[None]:
    """Turn an exception of a check into a finding, so that the other checks still report."""
    try:
        yield
    except (OSError, UserError) as error:
        findings.append(bad(check, reason_of(error), "fix that, then try again"))
    except Exception as error:  # noqa: BLE001 — a bug in one check must not hide the others
        findings.append(bad(check, describe_bug(error), "please report it"))


def reason_of(error: Exception) -> str:
    """Return an error as a part of a line."""
    if isinstance(error, OSError) and error.strerror:
        return (
            f"{redact_address(str(error.filename))}: {error.strerror}" if error.filename else error.strerror
        )
    return str(error)


def describe_bug(error: Exception) -> str:
    """Describe an unexpected exception, with addresses redacted."""
    return f"a bug in MyView: {type(error).__name__}: {redact_addresses(str(error))}"


_COLOURS = {Level.OK: "green", Level.WARNING: "yellow", Level.BAD: "red"}


def show(it: Finding, width: int, console: Console) -> None:
    """Print a line for a finding, with what to do behind an arrow; ``width`` is that of all checks' names."""
    colour = _COLOURS[it.level]
    do = f" → {it.do}" if it.do else ""
    head = f"[{colour}]{it.level.value:7}[/{colour}] {escape(f'{it.check:{width}}')}"
    console.print(f"{head}  {escape(printable(f'{it.text}{do}'))}", soft_wrap=True, highlight=False)


def show_counts(findings: Findings, console: Console) -> None:
    """Print how many there are of each level."""
    counts = {level: sum(it.level is level for it in findings.findings) for level in Level}
    console.print(", ".join(f"{count} {level.value}" for level, count in counts.items()), highlight=False)
