"""The table of faults, measured against the promises."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median_low

from benchmarks.common.report import Report
from benchmarks.faults.outcomes.fault_run import FaultOutcome

_BACK_S = 2.0
"""Promised seconds from the server's readiness to the next picture."""
_NOTES = 3


def describe(report: Report, outcomes: Sequence[FaultOutcome]) -> None:
    """Print the table of outcomes, and notes on errors."""
    columns = [
        "fault",
        "reconnects",
        "gap, s",
        "promised",
        "wrong pictures",
        "wrong boxes",
        "recorded",
        "exit",
    ]
    report.table("faults", [*columns, "kept"], [_row(outcome) for outcome in outcomes])
    for outcome in outcomes:
        notes = [
            outcome.failed,
            *(note for viewer in outcome.received for note in viewer.notes),
            *outcome.mismatches,
        ]
        notes += [
            f"{process.name}: {process.seconds:.2f} s, {process.code}"
            for process in outcome.exits
            if not process.clean
        ]
        for note in [note for note in notes if note][:_NOTES]:
            report.line(f"{outcome.fault.name}: {note}")
    for outcome in outcomes:
        late = [
            late
            for viewer in outcome.received
            for order in viewer.live_orders.values()
            for late in order.behind
        ]
        if late:
            lag = f"{min(late)} to {max(late)} frames behind their pulses, half of them {median_low(late)}"
            report.line(f"{outcome.fault.name}: pictures of the network camera are {lag} at most")
    broken = [outcome.fault.name for outcome in outcomes if not keeps_promises(outcome)]
    report.line(f"{len(outcomes) - len(broken)} of {len(outcomes)} keep all promises" + _broken_list(broken))


def keeps_promises(outcome: FaultOutcome) -> bool:
    """Return whether every promise was kept."""
    fault = outcome.fault
    if fault.kills_server and (
        outcome.recovery_s is None or max(outcome.recovery_s, outcome.page_recovery_s or 0.0) > _BACK_S
    ):
        return False
    if not fault.kills_server and outcome.reconnections:
        return False
    if fault.max_gap_s is not None and outcome.gap_after > fault.max_gap_s:
        return False
    if (
        outcome.lost is not None
        and not fault.stops_recording
        and outcome.lost > (1 if fault.kills_server else 0)
    ):
        return False
    return not (
        outcome.failed
        or _wrong(outcome)
        or outcome.broken_files
        or any(not process.clean for process in outcome.exits)
    )


def _wrong(outcome: FaultOutcome) -> bool:
    """Return whether any picture or box was wrong, or unnamed without a killed server."""
    unnamed = not outcome.fault.kills_server and any(viewer.unnamed for viewer in outcome.received)
    return (
        unnamed
        or bool(outcome.mismatches)
        or any(viewer.wrong or viewer.wrong_boxes for viewer in outcome.received)
    )


def _row(outcome: FaultOutcome) -> list[str]:
    received = outcome.received
    frames, boxes = sum(viewer.frames for viewer in received), sum(viewer.boxes for viewer in received)
    wrong, wrong_boxes = (
        sum(viewer.wrong for viewer in received),
        sum(viewer.wrong_boxes for viewer in received),
    )
    means = sum(viewer.averaged for viewer in received)
    wrong, unnamed = wrong + len(outcome.mismatches), sum(viewer.unnamed for viewer in received)
    slowest = max(outcome.exits, key=lambda process: process.seconds, default=None)
    return [
        outcome.fault.name,
        str(outcome.reconnections) if outcome.received else "",
        _gap_cell(outcome),
        _promise_cell(outcome),
        f"{wrong} of {frames}{f', {unnamed} unnamed' if unnamed else ''}" if outcome.received else "",
        f"{wrong_boxes} of {boxes - means}{f', {means} means' if means else ''}" if outcome.received else "",
        "" if outcome.lost is None else f"{outcome.lost} lost, {outcome.broken_files} broken",
        "" if slowest is None else f"{slowest.seconds:.2f} s, {slowest.code}",
        "yes" if keeps_promises(outcome) else "NO",
    ]


def _gap_cell(outcome: FaultOutcome) -> str:
    if not outcome.received:
        return ""
    if not outcome.fault.kills_server:
        return f"{outcome.gap_after:.2f} ({outcome.gap_before:.2f})"
    page = "" if outcome.page_recovery_s is None else f", page {outcome.page_recovery_s:.2f}"
    recovery = "never" if outcome.recovery_s is None else f"{outcome.recovery_s:.2f}"
    return f"{recovery}{page} ({outcome.gap_after:.2f})"


def _promise_cell(outcome: FaultOutcome) -> str:
    if outcome.fault.kills_server:
        return f"{_BACK_S:g}"
    return "" if outcome.fault.max_gap_s is None or not outcome.received else f"{outcome.fault.max_gap_s:g}"


def _broken_list(names: Sequence[str]) -> str:
    return f"; not: {', '.join(names)}" if names else ""
