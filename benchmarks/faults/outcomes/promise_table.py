"""The table of faults and promises."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median_low

from benchmarks.common.report import Report
from benchmarks.faults.outcomes.fault_run import FaultOutcome

_BACK_S = 2.0
"""Promised: from the server's return to the next picture."""
_NOTES = 3


def describe(report: Report, outcomes: Sequence[FaultOutcome]) -> None:
    """Print what was measured."""
    columns = [
        "fault",
        "opened again",
        "fresh, s",
        "promised",
        "wrong pictures",
        "wrong boxes",
        "recorded",
        "ended",
    ]
    report.table("faults", [*columns, "kept"], [_row(it) for it in outcomes])
    for outcome in outcomes:
        notes = [outcome.failed, *(note for it in outcome.received for note in it.notes), *outcome.unlike]
        notes += [f"{it.name}: {it.seconds:.2f} s, {it.code}" for it in outcome.ended if not it.well]
        for note in [note for note in notes if note][:_NOTES]:
            report.say(f"{outcome.fault.name}: {note}")
    for outcome in outcomes:
        late = [late for it in outcome.received for course in it.courses.values() for late in course.behind]
        if late:
            said = f"{min(late)} to {max(late)} frames behind their pulses, half of them {median_low(late)}"
            report.say(f"{outcome.fault.name}: pictures of the network camera are {said} at most")
    broken = [it.fault.name for it in outcomes if not kept(it)]
    report.say(f"{len(outcomes) - len(broken)} of {len(outcomes)} keep all promises" + _list(broken))


def kept(outcome: FaultOutcome) -> bool:
    """Whether every promise was kept."""
    fault = outcome.fault
    if fault.breaks and (outcome.back is None or max(outcome.back, outcome.page or 0.0) > _BACK_S):
        return False
    if not fault.breaks and outcome.reconnections:
        return False
    if fault.within is not None and outcome.without > fault.within:
        return False
    if outcome.lost is not None and not fault.unrecorded and outcome.lost > (1 if fault.breaks else 0):
        return False
    return not (
        outcome.failed or _wrong(outcome) or outcome.broken_files or any(not it.well for it in outcome.ended)
    )


def _wrong(outcome: FaultOutcome) -> bool:
    """Whether any picture or box was wrong, or may have been: nothing said of which camera it should be."""
    unnamed = not outcome.fault.breaks and any(it.unnamed for it in outcome.received)
    return unnamed or bool(outcome.unlike) or any(it.wrong or it.wrong_boxes for it in outcome.received)


def _row(it: FaultOutcome) -> list[str]:
    frames, boxes = sum(r.frames for r in it.received), sum(r.boxes for r in it.received)
    wrong, wrong_boxes = sum(r.wrong for r in it.received), sum(r.wrong_boxes for r in it.received)
    means = sum(r.blurred for r in it.received)
    wrong, unnamed = wrong + len(it.unlike), sum(r.unnamed for r in it.received)
    slowest = max(it.ended, key=lambda one: one.seconds, default=None)
    return [
        it.fault.name,
        str(it.reconnections) if it.received else "",
        _fresh(it),
        _promised(it),
        f"{wrong} of {frames}{f', {unnamed} unnamed' if unnamed else ''}" if it.received else "",
        f"{wrong_boxes} of {boxes - means}{f', {means} means' if means else ''}" if it.received else "",
        "" if it.lost is None else f"{it.lost} lost, {it.broken_files} broken",
        "" if slowest is None else f"{slowest.seconds:.2f} s, {slowest.code}",
        "yes" if kept(it) else "NO",
    ]


def _fresh(it: FaultOutcome) -> str:
    if not it.received:
        return ""
    if not it.fault.breaks:
        return f"{it.without:.2f} ({it.ordinary:.2f})"
    page = "" if it.page is None else f", page {it.page:.2f}"
    return f"{'never' if it.back is None else f'{it.back:.2f}'}{page} ({it.without:.2f})"


def _promised(it: FaultOutcome) -> str:
    if it.fault.breaks:
        return f"{_BACK_S:g}"
    return "" if it.fault.within is None or not it.received else f"{it.fault.within:g}"


def _list(names: Sequence[str]) -> str:
    return f"; not: {', '.join(names)}" if names else ""
