"""Every flag and every failure as rows, beside those of the thesis's Table 2 (Todor 2009, section 8.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import get_args

from benchmarks.operator_assist.flag_outcomes import CAUSES, Outcome, OutcomeCounts
from benchmarks.operator_assist.identity_failures import Kind

_CLIPS_MINUTES = 56 * 20.0 / 60.0
"""The thesis's: 56 clips of 20 seconds, each of nine fish."""

_WORDS: dict[Outcome, str] = {
    "helped": "the operator helped",
    "not needed": "was not needed: a false flag",
    "harmed": "the operator harmed",
    "no help": "could not help",
}


@dataclass(frozen=True, slots=True)
class OutcomeRow:
    """One row: what was counted, and the thesis's count, where it counted the same."""

    name: str
    count: int
    thesis: int | None = None


@dataclass(frozen=True, slots=True)
class _FlagGroup:
    """Flags by whether others were in the way; the thesis's counts of them, and of the two outcomes."""

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


def table2(cases: OutcomeCounts) -> list[OutcomeRow]:
    """Return the counts in the thesis's order.

    It counts cases, of which each has a flag at most; of failures of more than two it does not say how many
    had a flag, and of those alone, not what the operator did. What it has of why there was no flag it has of
    crossings of two only.
    """
    return [
        OutcomeRow("flagged, tracked rightly", _sum(cases, ("helped", "not needed")), 53),
        *_split(cases, _RIGHT, ("helped", "not needed")),
        OutcomeRow("flagged, tracked wrongly", _sum(cases, ("harmed", "no help"))),
        *_split(cases, _WRONG, ("harmed", "no help")),
        OutcomeRow("failures with help", cases.left.total(), 39),
        *(OutcomeRow(f"  {kind}", cases.kinds[kind], thesis) for kind, thesis in _LEFT),
        *(OutcomeRow(f"  {cause}", cases.left[cause]) for cause in CAUSES),
    ]


def head(*, thesis: bool) -> list[str]:
    """Return the columns of `texts`."""
    return ["", "count", *(["as 56 clips", "thesis"] if thesis else [])]


def texts(cases: OutcomeCounts, *, thesis: bool) -> list[list[str]]:
    """Return the rows as words; `thesis`: with its counts, and ours for as many minutes as it has."""
    scale = _CLIPS_MINUTES / cases.minutes
    return [
        [
            it.name,
            str(it.count),
            *([f"{scale * it.count:.0f}", "-" if it.thesis is None else str(it.thesis)] if thesis else []),
        ]
        for it in table2(cases)
    ]


def _split(
    cases: OutcomeCounts, parts: Sequence[_FlagGroup], outcomes: tuple[Outcome, Outcome]
) -> Iterator[OutcomeRow]:
    """Yield flags of these outcomes by whether others were in the way, and by outcome."""
    for it in parts:
        yield OutcomeRow(it.name, _sum(cases, outcomes, it.kinds), it.thesis)
        for outcome, theirs in zip(outcomes, it.theirs, strict=True):
            yield OutcomeRow(f"    {_WORDS[outcome]}", _sum(cases, (outcome,), it.kinds), theirs)


def _sum(cases: OutcomeCounts, outcomes: Sequence[Outcome], kinds: Sequence[Kind] = get_args(Kind)) -> int:
    return sum(cases.flags[kind, outcome] for kind in kinds for outcome in outcomes)
