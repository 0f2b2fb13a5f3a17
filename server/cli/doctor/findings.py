"""Findings of the doctor: one line per check, with level and remedy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import Enum

import msgspec
from rich.console import Console
from rich.markup import escape

from server.system.address_redaction import cut_at_addresses, located_reason_of
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
    remedy: str = ""
    """What to do; empty: nothing."""


class Findings(msgspec.Struct, frozen=True):
    """All findings, as ``--json`` prints them."""

    ok: bool
    """Whether no finding is bad."""
    findings: list[Finding]


def ok(check: str, text: str) -> Finding:
    """Build a finding for a check that passed."""
    return Finding(check, Level.OK, text)


def warning(check: str, text: str, remedy: str) -> Finding:
    """Build a finding for something that should be looked at."""
    return Finding(check, Level.WARNING, text, remedy)


def bad(check: str, text: str, remedy: str = "") -> Finding:
    """Build a finding for something that does not work."""
    return Finding(check, Level.BAD, text, remedy)


def collect_findings(findings: Sequence[Finding]) -> Findings:
    """Return findings with their overall result."""
    return Findings(all(finding.level is not Level.BAD for finding in findings), list(findings))


@contextmanager
def report_failure(check: str, findings: list[Finding]) -> Iterator[None]:
    """Turn an exception of a check into a finding, so that the other checks still report."""
    try:
        yield
    except (OSError, UserError) as error:
        findings.append(bad(check, located_reason_of(error), "fix that, then try again"))
    except Exception as error:  # noqa: BLE001 — a bug in one check must not hide the others
        findings.append(bad(check, describe_bug(error), "please report it"))


def describe_bug(error: Exception) -> str:
    """Describe an unexpected exception, with addresses redacted."""
    return f"a bug in MyView: {type(error).__name__}: {cut_at_addresses(str(error))}"


_COLORS = {Level.OK: "green", Level.WARNING: "yellow", Level.BAD: "red"}


def show(finding: Finding, check_width: int, console: Console) -> None:
    """Print a finding in one line, with the remedy behind an arrow; ``check_width`` is the first column's."""
    color = _COLORS[finding.level]
    remedy = f" → {finding.remedy}" if finding.remedy else ""
    head = f"[{color}]{finding.level.value:7}[/{color}] {escape(f'{finding.check:{check_width}}')}"
    text = escape(printable(f"{finding.text}{remedy}"))
    console.print(f"{head}  {text}", soft_wrap=True, highlight=False)


def show_counts(findings: Findings, console: Console) -> None:
    """Print the number of findings of each level."""
    counts = {level: sum(finding.level is level for finding in findings.findings) for level in Level}
    console.print(", ".join(f"{count} {level.value}" for level, count in counts.items()), highlight=False)
