"""The table of failures, measured against the promises."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.common.report import Report
from benchmarks.faults.failover.failover_run import FailoverOutcome
from benchmarks.faults.failover.failures import MOVED_S, NOTICED_S, SILENT_S

_KINDS = ("client", "page", "HLS", "MP4")


def describe(report: Report, outcomes: Sequence[FailoverOutcome]) -> None:
    """Print the table of outcomes, and why measurements failed."""
    columns = [
        "failure",
        "process",
        "others, s",
        *(f"{kind}, s" for kind in _KINDS),
        "numbers",
        "lost",
        "kept",
    ]
    report.table("failover", columns, [_row(outcome) for outcome in outcomes])
    for outcome in outcomes:
        if outcome.failed:
            report.line(f"{outcome.failure.name}: {outcome.failed}")
        if outcome.broken or outcome.wrong or outcome.broken_files:
            report.line(
                f"{outcome.failure.name}: {outcome.broken} other streams broke, {outcome.wrong} wrong "
                f"pictures, {outcome.broken_files} files do not play"
            )
    kept = sum(outcome.keeps_promises for outcome in outcomes)
    report.line(
        f"{kept} of {len(outcomes)} keep all promises: {NOTICED_S:g} s for others, {MOVED_S:g} s for viewers "
        f"of a service that fails, {SILENT_S:g} s where a camera or tracker falls silent"
    )


def _row(outcome: FailoverOutcome) -> list[str]:
    others = max(outcome.others.values(), default=None)
    return [
        outcome.failure.name,
        outcome.process,
        "" if others is None else f"{others:.2f} ({outcome.before:.2f})",
        *(_cell(outcome, kind) for kind in _KINDS),
        str(outcome.changed),
        "" if outcome.lost is None else str(outcome.lost),
        "yes" if outcome.keeps_promises else "NO",
    ]


def _cell(outcome: FailoverOutcome, kind: str) -> str:
    if kind not in outcome.own:
        return ""
    reconnections = outcome.reconnections.get(kind, 0)
    return f"{outcome.own[kind]:.2f}" + (f" ({reconnections})" if reconnections else "")
