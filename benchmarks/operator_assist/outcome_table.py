"""The table of flags and failures, with the counts of the thesis's Table 2 (Todor 2009, section 8.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import get_args

from benchmarks.operator_assist.flag_outcomes import CAUSES, Outcome, OutcomeCounts
from benchmarks.operator_assist.identity_failures import Kind

_CLIPS_MINUTES = 56 * 20.0 / 60.0
"""Minutes of the thesis's 56 clips of 20 seconds, each of nine fish."""

_WORDS: dict[Outcome, str] = {
    "helped": "the operator helped",
    "not needed": "not needed: a false flag",
    "harmed": "the operator harmed",
    "no help": "could not help",
}


@dataclass(frozen=True, slots=True)
class OutcomeRow:
    """A row: a count, and the thesis's count, where it counted the same."""

    name: str
    count: int
    thesis: int | None = None


@dataclass(frozen=True, slots=True)
class _FlagGroup:
    """A group of flags by kind; the thesis's counts of them, and of the two outcomes."""

    name: str
    kinds: Sequence[Kind]
    thesis: int | None = None
    theirs: tuple[int | None, int | None] = (None, None)


_RIGHT = (
    _FlagGroup("  crossings", ("2 way", "3 way"), 44, (11, 33)),
    _FlagGroup("  alone", ("alone",), 9),
)
_WRONG = (
    _FlagGroup("  2 way", ("2 way",), 8, (4, 4)),
    _FlagGroup("  3 way", ("3 way",)),
    _FlagGroup("  alone", ("alone",), 6),
)
_LEFT: Sequence[tuple[Kind, int]] = (("2 way", 15), ("3 way", 15), ("alone", 9))


def table2(outcome_counts: OutcomeCounts) -> list[OutcomeRow]:
    """Return the counts in the thesis's order.

    The thesis counts cases with at most one flag each; it does not say how many failures of more than two
    fish had a flag, nor what the operator did in failures of single fish. It has the causes of missing flags
    for crossings of two only.
    """
    return [
        OutcomeRow("flagged, tracked correctly", _sum(outcome_counts, ("helped", "not needed")), 53),
        *_split(outcome_counts, _RIGHT, ("helped", "not needed")),
        OutcomeRow("flagged, tracked wrongly", _sum(outcome_counts, ("harmed", "no help"))),
        *_split(outcome_counts, _WRONG, ("harmed", "no help")),
        OutcomeRow("failures with help", outcome_counts.left.total(), 39),
        *(OutcomeRow(f"  {kind}", outcome_counts.kinds[kind], thesis) for kind, thesis in _LEFT),
        *(OutcomeRow(f"  {cause}", outcome_counts.left[cause]) for cause in CAUSES),
    ]


def head(*, thesis: bool) -> list[str]:
    """Return the column headings of `texts`."""
    return ["", "count", *(["as 56 clips", "thesis"] if thesis else [])]


def texts(outcome_counts: OutcomeCounts, *, thesis: bool) -> list[list[str]]:
    """Return the rows as text; `thesis`: with its counts, and ours scaled to its minutes."""
    scale = _CLIPS_MINUTES / outcome_counts.minutes
    return [
        [
            row.name,
            str(row.count),
            *([f"{scale * row.count:.0f}", "-" if row.thesis is None else str(row.thesis)] if thesis else []),
        ]
        for row in table2(outcome_counts)
    ]


def _split(
    outcome_counts: OutcomeCounts, parts: Sequence[_FlagGroup], outcomes: tuple[Outcome, Outcome]
) -> Iterator[OutcomeRow]:
    """Yield the rows of flags with these outcomes, by group and by outcome."""
    for part in parts:
        yield OutcomeRow(part.name, _sum(outcome_counts, outcomes, part.kinds), part.thesis)
        for outcome, theirs in zip(outcomes, part.theirs, strict=True):
            yield OutcomeRow(f"    {_WORDS[outcome]}", _sum(outcome_counts, (outcome,), part.kinds), theirs)


def _sum(
    outcome_counts: OutcomeCounts, outcomes: Sequence[Outcome], kinds: Sequence[Kind] = get_args(Kind)
) -> int:
    return sum(outcome_counts.flags[kind, outcome] for kind in kinds for outcome in outcomes)
