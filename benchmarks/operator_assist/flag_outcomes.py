"""The outcomes of flags and the causes of failures: Table 2 of the thesis (Todor 2009, section 8.2)."""

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
"""The cause of a remaining failure: the operator pointed at the right fish before it, in vain; followed
another fish than the flagged track's; pointed too late; was busy with other flags; it was foreseen, but other
risk events got the flags; its tracks had failed before; or it was not foreseen."""

CAUSES: tuple[Cause, ...] = get_args(Cause)

_BEFORE_S = 3.0
"""Seconds before a failure in which a risk event or a flag of its tracks counts as about it."""


@dataclass(frozen=True, slots=True)
class OutcomeCounts:
    """The counts of some clips.

    Attributes:
        minutes: of video.
        clips: number of clips.
        flags: by kind (occlusion by others) and by outcome.
        unaided: failures without help, by kind.
        foreseen: those with an early enough risk event.
        left: failures with help, by cause.
        kinds: failures with help, by kind.
        avoided: failures without help that do not occur with it.
        caused: failures with help that do not occur without.
    """

    minutes: float
    clips: int
    flags: Counter[tuple[Kind, Outcome]]
    unaided: Counter[Kind]
    foreseen: int
    left: Counter[Cause]
    kinds: Counter[Kind]
    avoided: int
    caused: int

    @property
    def flags_a_minute(self) -> float:
        """Flags raised per minute of video."""
        return self.flags.total() / self.minutes if self.minutes else 0.0


def count(pairs: Sequence[tuple[TrackedClip, TrackedClip]], person: OperatorProfile) -> OutcomeCounts:
    """Count over clips that were tracked twice: without and with help."""
    flags: Counter[tuple[Kind, Outcome]] = Counter()
    unaided: Counter[Kind] = Counter()
    left: Counter[Cause] = Counter()
    kinds: Counter[Kind] = Counter()
    foreseen = avoided = caused = 0
    for alone, helped in pairs:
        fps = alone.clip.fps
        matched = matches(helped.clip.truth, helped.tracks)
        for flag in helped.flags:
            about = _about(flag, matched)
            flags[_kind(flag, about, helped), _outcome(flag, about, alone, helped)] += 1
        for failure in alone.failures:
            unaided[failure.kind] += 1
            foreseen += any(is_about(event, at, failure, fps, person) for at, event in alone.risk_events)
            avoided += not _in_other_run(failure, helped.failures, fps)
        for failure in helped.failures:
            kinds[failure.kind] += 1
            left[_cause(failure, helped, matched)] += 1
            caused += not _in_other_run(failure, alone.failures, fps)
    minutes = sum(alone.clip.minutes for alone, _ in pairs)
    return OutcomeCounts(minutes, len(pairs), flags, unaided, foreseen, left, kinds, avoided, caused)


def _about(flag: OperatorFlag, matched: NDArray[np.int64]) -> set[int]:
    """Return the fish that a flag is about: those under its tracks when it was raised, or last before.

    And the fish that the operator followed. Empty where the tracks were on no fish. `matched` is the track
    that each fish is matched with, `(n, T)`.
    """
    about = set() if flag.fish is None else {flag.fish}
    for number in flag.event.objects:
        fish, frames = np.nonzero(matched[:, : flag.raised + 1] == number)
        about |= set(fish[frames == frames.max(initial=-1)].tolist())
    return about


def _kind(flag: OperatorFlag, about: set[int], helped: TrackedClip) -> Kind:
    """Return whether others occluded a flagged person between the flag and its risk event."""
    first, last = sorted((flag.event.frame, flag.raised))
    return kind_of(involved(helped.clip.truth, about, first, last, helped.clip.fps))


def _outcome(flag: OperatorFlag, about: set[int], alone: TrackedClip, helped: TrackedClip) -> Outcome:
    """Return the outcome of a flag: whether its fish failed without help, with it, both, or neither."""
    fps = helped.clip.fps
    ended = flag.until if flag.ended is None else max(flag.ended, flag.until)
    first, last = min(flag.event.frame, flag.raised) - _BEFORE_S * fps, max(ended, flag.raised) + fps

    def failed(clip_result: TrackedClip) -> bool:
        return any(
            about & {*failure.fish} and failure.before <= last and failure.frame >= first
            for failure in clip_result.failures
        )

    without, with_help = failed(alone), failed(helped)
    if without:
        return "no help" if with_help else "helped"
    return "harmed" if with_help else "not needed"


def is_about(
    event: RiskEvent, newest: int, failure: IdentityFailure, fps: float, person: OperatorProfile
) -> bool:
    """Return whether a risk event is about a failure, and early enough for the operator."""
    early = newest - person.delay_s * fps + person.reaction_s * fps <= failure.frame
    return bool(early and newest >= failure.before - _BEFORE_S * fps and {*event.objects} & {*failure.tracks})


def _in_other_run(failure: IdentityFailure, others: Sequence[IdentityFailure], fps: float) -> bool:
    """Return whether a failure also occurs in the other run: the same fish at about the same time."""
    return any(
        {*failure.fish} & {*other.fish}
        and other.before <= failure.frame + fps
        and other.frame >= failure.before - fps
        for other in others
    )


def _cause(failure: IdentityFailure, helped: TrackedClip, matched: NDArray[np.int64]) -> Cause:
    """Return the cause of a remaining failure; `matched` is the track of each fish, `(n, T)`."""
    fps, own_tracks = helped.clip.fps, {*failure.tracks}
    first, last = failure.before - _BEFORE_S * fps, failure.frame + fps
    flags = [
        flag
        for flag in helped.flags
        if (own_tracks & {*flag.event.objects} or flag.fish in failure.fish) and first <= flag.raised <= last
    ]
    handled = [flag for flag in flags if flag.fish is not None and flag.pointing_frames]
    if any(_right(flag, matched) and flag.pointing_frames[0] <= failure.frame for flag in handled):
        return "pointed in vain"
    if handled:
        return "late" if any(_right(flag, matched) for flag in handled) else "followed wrongly"
    if flags:
        return "busy" if any(flag.begun is None for flag in flags) else "late"
    if any(
        earlier.frame < failure.before and {*earlier.tracks} & own_tracks
        for earlier in helped.failures
        if earlier is not failure
    ):
        return "earlier failure"
    was_foreseen = any(
        own_tracks & {*event.objects} and first <= newest <= last for newest, event in helped.risk_events
    )
    return "no flag" if was_foreseen else "not foreseen"


def _right(flag: OperatorFlag, matched: NDArray[np.int64]) -> bool:
    """Return whether the followed fish is the one that the flagged track was on before."""
    before = matched[flag.fish, : max(flag.pointing_frames[0], 1)]
    known = before[before > 0]
    return bool(len(known) and known[-1] == flag.object)
