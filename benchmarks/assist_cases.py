"""What became of every flag and of every failure: the thesis's Table 2 (Todor 2009, section 8.2)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from benchmarks.assist_failures import Failure
from benchmarks.assist_operator import Flag, Person
from benchmarks.assist_watch import Watched
from tracking.assist import Trouble

Outcome = Literal["helped", "not needed", "harmed", "no help"]
Cause = Literal["flagged", "busy", "earlier failure", "not foreseen"]
"""Why a failure is left: the operator was asked and it failed all the same; was busy with others; its tracks
had failed before; or nothing had been foreseen."""

CAUSES: tuple[Cause, ...] = ("flagged", "busy", "earlier failure", "not foreseen")

_BEFORE_S = 3.0
"""Seconds before a failure in which a trouble or a flag of its tracks is about it."""


@dataclass(frozen=True, slots=True)
class Cases:
    """The counts of some clips.

    Attributes:
        minutes: of video.
        clips: how many.
        flags: by outcome, and whether others were in the way when it was raised.
        unaided: failures without help, by kind.
        foreseen: those that a trouble told of early enough to be answered.
        told: those that a trouble told of at any time before they were final and shown.
        left: failures with help, by cause.
        kinds: failures with help, by kind.
        avoided: failures without help that are none with it.
        made: failures with help that were none without.
    """

    minutes: float
    clips: int
    flags: Counter[Outcome]
    crossings: Counter[Outcome]
    unaided: Counter[str]
    foreseen: int
    left: Counter[Cause]
    kinds: Counter[str]
    avoided: int
    made: int

    @property
    def flags_a_minute(self) -> float:
        """Flags raised a minute of video."""
        return self.flags.total() / self.minutes if self.minutes else 0.0


def count(pairs: Sequence[tuple[Watched, Watched]], person: Person) -> Cases:
    """Count over clips that were watched twice: without help, and with it."""
    cases = Cases(
        sum(alone.clip.minutes for alone, _ in pairs),
        len(pairs),
        Counter(),
        Counter(),
        Counter(),
        0,
        Counter(),
        Counter(),
        0,
        0,
    )
    foreseen = avoided = made = 0
    for alone, helped in pairs:
        fps = alone.clip.fps
        for flag in helped.flags:
            outcome = _outcome(flag, alone, helped, fps)
            cases.flags[outcome] += 1
            if flag.trouble.reason != "fading":
                cases.crossings[outcome] += 1
        for failure in alone.failures:
            cases.unaided[failure.kind] += 1
            foreseen += any(_tells(it, at, failure, fps, person) for at, it in alone.troubles)
            avoided += not _again(failure, helped.failures, fps)
        for failure in helped.failures:
            cases.kinds[failure.kind] += 1
            cases.left[_cause(failure, helped, fps)] += 1
            made += not _again(failure, alone.failures, fps)
    return Cases(
        cases.minutes,
        cases.clips,
        cases.flags,
        cases.crossings,
        cases.unaided,
        foreseen,
        cases.left,
        cases.kinds,
        avoided,
        made,
    )


def _outcome(flag: Flag, alone: Watched, helped: Watched, fps: float) -> Outcome:
    """Say what a flag was good for: whom it was about failed without help, with it, both, or neither."""
    ended = flag.ended if flag.ended is not None else flag.raised
    first, last = min(flag.trouble.frame, flag.raised) - _BEFORE_S * fps, ended + fps
    fish = {flag.fish} if flag.fish is not None else set()

    def failed(watched: Watched) -> bool:
        return any(fish & {*it.fish} and it.before <= last and it.frame >= first for it in watched.failures)

    without, with_help = failed(alone), failed(helped)
    if without:
        return "no help" if with_help else "helped"
    return "harmed" if with_help else "not needed"


def _tells(trouble: Trouble, newest: int, failure: Failure, fps: float, person: Person) -> bool:
    """Say whether a trouble is about a failure, and came early enough for the operator to see it happen."""
    early = newest - person.delay_s * fps + person.reaction_s * fps <= failure.frame
    return bool(
        early and newest >= failure.before - _BEFORE_S * fps and {*trouble.objects} & {*failure.tracks}
    )


def _again(failure: Failure, others: Sequence[Failure], fps: float) -> bool:
    """Say whether a failure is among those of the other run: the same fish, at about the same time."""
    return any(
        {*failure.fish} & {*it.fish} and it.before <= failure.frame + fps and it.frame >= failure.before - fps
        for it in others
    )


def _cause(failure: Failure, helped: Watched, fps: float) -> Cause:
    first = failure.before - _BEFORE_S * fps
    mine = {*failure.tracks}
    if any(
        (mine & {*it.trouble.objects} or it.fish in failure.fish)
        and first <= it.raised <= failure.frame + fps
        for it in helped.flags
    ):
        return "flagged"
    if any(mine & {*it.objects} and first <= it.frame <= failure.frame + fps for it in helped.missed):
        return "busy"
    if any(it.frame < failure.before and {*it.tracks} & mine for it in helped.failures if it is not failure):
        return "earlier failure"
    return "not foreseen"
