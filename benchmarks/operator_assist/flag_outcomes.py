"""What became of every flag and of every failure: the thesis's Table 2 (Todor 2009, section 8.2)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from benchmarks.operator_assist.assisted_tracking import TrackedClip
from benchmarks.operator_assist.identity_failures import IdentityFailure, Kind, involved, kind_of, matches
from benchmarks.operator_assist.simulated_operator import OperatorFlag, OperatorProfile
from tracking.interactive import RiskEvent

Outcome = Literal["helped", "not needed", "harmed", "no help"]
Cause = Literal[
    "pointed in vain", "followed wrongly", "late", "busy", "no flag", "earlier failure", "not foreseen"
]
"""Why a failure is left: the operator pointed at the right fish before and after it; followed another fish
than the track that was named had been on; had not pointed when it happened; was busy with other flags;
it was foreseen, but others were more worth a flag; its tracks had failed before; or nothing was foreseen."""

CAUSES: tuple[Cause, ...] = get_args(Cause)

_BEFORE_S = 3.0
"""Seconds before a failure in which a trouble or a flag of its tracks is about it."""


@dataclass(frozen=True, slots=True)
class OutcomeCounts:
    """The counts of some clips.

    Attributes:
        minutes: of video.
        clips: how many.
        flags: by whether others were in the way of whom it was about, and by outcome.
        unaided: failures without help, by kind.
        foreseen: those that a trouble told of early enough to be answered.
        left: failures with help, by cause.
        kinds: failures with help, by kind.
        avoided: failures without help that are none with it.
        made: failures with help that were none without.
    """

    minutes: float
    clips: int
    flags: Counter[tuple[Kind, Outcome]]
    unaided: Counter[Kind]
    foreseen: int
    left: Counter[Cause]
    kinds: Counter[Kind]
    avoided: int
    made: int

    @property
    def flags_a_minute(self) -> float:
        """Flags raised a minute of video."""
        return self.flags.total() / self.minutes if self.minutes else 0.0


def count(pairs: Sequence[tuple[TrackedClip, TrackedClip]], person: OperatorProfile) -> OutcomeCounts:
    """Count over clips that were watched twice: without help, and with it."""
    flags: Counter[tuple[Kind, Outcome]] = Counter()
    unaided: Counter[Kind] = Counter()
    left: Counter[Cause] = Counter()
    kinds: Counter[Kind] = Counter()
    foreseen = avoided = made = 0
    for alone, helped in pairs:
        fps = alone.clip.fps
        found = matches(helped.clip.truth, helped.tracks)
        for flag in helped.flags:
            about = _about(flag, found)
            flags[_kind(flag, about, helped), _outcome(flag, about, alone, helped)] += 1
        for failure in alone.failures:
            unaided[failure.kind] += 1
            foreseen += any(tells(it, at, failure, fps, person) for at, it in alone.troubles)
            avoided += not _again(failure, helped.failures, fps)
        for failure in helped.failures:
            kinds[failure.kind] += 1
            left[_cause(failure, helped, found)] += 1
            made += not _again(failure, alone.failures, fps)
    minutes = sum(alone.clip.minutes for alone, _ in pairs)
    return OutcomeCounts(minutes, len(pairs), flags, unaided, foreseen, left, kinds, avoided, made)


def _about(flag: OperatorFlag, found: NDArray[np.int64]) -> set[int]:
    """Return the fish that a flag is about: on whom its tracks were when it was raised, or last before.

    And who was followed, whom the operator took for one of them. Nobody, where the tracks were on no fish.
    `found` is which track each fish was matched with, `(n, T)`.
    """
    about = set() if flag.fish is None else {flag.fish}
    for number in flag.trouble.objects:
        fish, frames = np.nonzero(found[:, : flag.raised + 1] == number)
        about |= set(fish[frames == frames.max(initial=-1)].tolist())
    return about


def _kind(flag: OperatorFlag, about: set[int], helped: TrackedClip) -> Kind:
    """Return whether others occluded a flagged person between the flag and its risk event."""
    first, last = sorted((flag.trouble.frame, flag.raised))
    return kind_of(involved(helped.clip.truth, about, first, last, helped.clip.fps))


def _outcome(flag: OperatorFlag, about: set[int], alone: TrackedClip, helped: TrackedClip) -> Outcome:
    """Return what a flag was good for: whom it was about failed without help, with it, both, or neither."""
    fps = helped.clip.fps
    ended = flag.until if flag.ended is None else max(flag.ended, flag.until)
    first, last = min(flag.trouble.frame, flag.raised) - _BEFORE_S * fps, max(ended, flag.raised) + fps

    def failed(watched: TrackedClip) -> bool:
        return any(about & {*it.fish} and it.before <= last and it.frame >= first for it in watched.failures)

    without, with_help = failed(alone), failed(helped)
    if without:
        return "no help" if with_help else "helped"
    return "harmed" if with_help else "not needed"


def tells(
    trouble: RiskEvent, newest: int, failure: IdentityFailure, fps: float, person: OperatorProfile
) -> bool:
    """Return whether a risk event is about a failure, and early enough for the operator to see it."""
    early = newest - person.delay_s * fps + person.reaction_s * fps <= failure.frame
    return bool(
        early and newest >= failure.before - _BEFORE_S * fps and {*trouble.objects} & {*failure.tracks}
    )


def _again(failure: IdentityFailure, others: Sequence[IdentityFailure], fps: float) -> bool:
    """Return whether a failure is among those of the other run: the same fish, at about the same time."""
    return any(
        {*failure.fish} & {*it.fish} and it.before <= failure.frame + fps and it.frame >= failure.before - fps
        for it in others
    )


def _cause(failure: IdentityFailure, helped: TrackedClip, found: NDArray[np.int64]) -> Cause:
    """Return why a failure is left; `found` is which track each fish was matched with, `(n, T)`."""
    fps, mine = helped.clip.fps, {*failure.tracks}
    first, last = failure.before - _BEFORE_S * fps, failure.frame + fps
    flags = [
        it
        for it in helped.flags
        if (mine & {*it.trouble.objects} or it.fish in failure.fish) and first <= it.raised <= last
    ]
    seen_to = [it for it in flags if it.fish is not None and it.looks]
    if any(_right(it, found) and it.looks[0] <= failure.frame for it in seen_to):
        return "pointed in vain"
    if seen_to:
        return "late" if any(_right(it, found) for it in seen_to) else "followed wrongly"
    if flags:
        return "busy" if any(it.begun is None for it in flags) else "late"
    if any(it.frame < failure.before and {*it.tracks} & mine for it in helped.failures if it is not failure):
        return "earlier failure"
    told = any(mine & {*it.objects} and first <= newest <= last for newest, it in helped.troubles)
    return "no flag" if told else "not foreseen"


def _right(flag: OperatorFlag, found: NDArray[np.int64]) -> bool:
    """Return whether the fish that was followed is the one that the named track was on before."""
    before = found[flag.fish, : max(flag.looks[0], 1)]
    known = before[before > 0]
    return bool(len(known) and known[-1] == flag.object)
