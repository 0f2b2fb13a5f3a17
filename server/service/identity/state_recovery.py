"""Who is who goes on when the service is started anew: tracks that are still followed are whose they were."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from itertools import chain
from math import inf

from server.messaging.identity_snapshot import (
    ALIASES_MAX,
    PERSON_NUMBER_MAX,
    IdentitySnapshot,
    PersonSnapshot,
)
from server.service.identity.local_numbers import TrackName
from server.service.identity.people import PersonTracker

SINGLE_CAMERA_NUMBER_MAX = 1_000_000
"""The first free number that is believed of one camera alone: larger ones another must say, too."""
_NUMBER_SLACK = 10_000
"""Numbers by which the newest word may be ahead of the one before: nobody gives so many in a second."""
MAX_DOWNTIME_S = 30.0
"""Seconds that the service may be away: in a longer time a track may have gone over to somebody else."""


def state_for_cameras(
    people: PersonTracker, cameras: Iterable[str], pulse: int, recent: int, since: float
) -> dict[str, IdentitySnapshot]:
    """Build the state that each camera retains: whom it followed lately, and the first free number."""
    followed = people.followed(people.registry.everybody, pulse - recent)
    boots: dict[str, int] = {}
    for it in chain.from_iterable(followed.values()):
        boots[it.camera] = max(it.boot, boots.get(it.camera, 0))
    also: dict[int, list[int]] = {}
    for old, number in people.registry.merged.items():
        if old <= PERSON_NUMBER_MAX:
            also.setdefault(number, []).append(old)
    by_hand = set(people.merged_by_hand.values())
    known: dict[str, list[PersonSnapshot]] = {camera: [] for camera in cameras}
    for number, tracks in followed.items():
        if number > PERSON_NUMBER_MAX:
            continue
        mine: dict[str, list[int]] = {}
        for it in tracks:
            if it.boot == boots[it.camera]:  # of a run of the camera that is over nobody remembers anything
                mine.setdefault(it.camera, []).append(it.track)
        for camera, theirs in mine.items():
            known[camera].append(
                PersonSnapshot(
                    number=number,
                    tracks=theirs,
                    aliases=also.get(number, [])[-ALIASES_MAX:],
                    name=people.registry.names.get(number, ""),
                    manual=number in by_hand,
                )
            )
    following = min(people.next_number, PERSON_NUMBER_MAX + 1)
    return {
        camera: IdentitySnapshot(
            pulse=pulse, boot=boots.get(camera, 0), next_number=following, numbered_since=since, people=them
        )
        for camera, them in known.items()
    }


@dataclass(frozen=True, slots=True)
class _Awaited:
    """One person, whom tracks of several cameras may follow."""

    number: int
    tracks: tuple[TrackName, ...]
    also: tuple[int, ...]
    name: str
    by_hand: bool


class StateRecovery:
    """Restores people's numbers and manual overrides after a restart, as their tracks are seen again.

    Args:
        said: what each camera remembers; only what is said of now counts.
        pulse: where the service begins.
        longest: frames that it may have been away.
    """

    def __init__(self, said: dict[str, IdentitySnapshot], pulse: int, longest: int) -> None:
        self._until = -1
        self._over = False
        self._tracks: dict[TrackName, int] = {}
        self._awaited: list[_Awaited] = []
        self._found: dict[TrackName, int] = {}
        """The pulse at which each track was first heard of again."""
        self.next_number = max((first_free_number(it) for it in said.values()), default=1)
        """No number below it is given any more, however long ago that was."""
        recent = {camera: it for camera, it in said.items() if it.pulse < pulse <= it.pulse + longest}
        # All that were told of lately were told the same: one that says otherwise does not decide.
        since = sorted(it.numbered_since for it in recent.values())
        self.numbered_since = (
            since[len(since) // 2] if since else max((it.numbered_since for it in said.values()), default=inf)
        )
        """When numbers began, unix seconds; infinite: nobody remembers."""
        if recent:
            self._until = max(it.pulse for it in recent.values()) + longest
            self._awaited = _awaited(recent)
            self._tracks = {track: it.number for it in self._awaited for track in it.tracks}

    @property
    def over(self) -> bool:
        """Whether nobody is awaited any more: tracks of those who were found may still come."""
        return self._over

    @property
    def numbers(self) -> Collection[int]:
        """The numbers of those who are awaited, with those that they once had."""
        return {number for it in self._awaited for number in (it.number, *it.also)}

    def begin(self, people: PersonTracker, pulse: int) -> None:
        """Assign the awaited tracks to their people before any of them is reported."""
        people.begin_at(self.next_number)
        people.expect(self._tracks, pulse - 1)

    def look(self, people: PersonTracker, pulse: int) -> None:
        """Look for them after an epoch that ends with a pulse was taken in."""
        if pulse > self._until:
            self._awaited, self._over = [], True
            people.cancel_expected(self._tracks)
        self._awaited = [it for it in self._awaited if not self._restore(it, people, pulse)]

    def _restore(self, awaited: _Awaited, people: PersonTracker, pulse: int) -> bool:
        """Return whether somebody is here again, with all that is to be said of them said."""
        found = [self._number(it, people, pulse) for it in awaited.tracks]
        numbers = sorted({it for it in found if it is not None})
        if not numbers:
            return False
        kept = awaited.number if awaited.number in numbers else numbers[0]
        if awaited.name and kept not in people.registry.names:
            people.registry.set_name(kept, awaited.name)
        people.registry.add_aliases(kept, awaited.also)
        for other in numbers if awaited.by_hand else ():
            if other != kept:
                people.merge(kept, other)
        return not awaited.by_hand or None not in found

    def _number(self, track: TrackName, people: PersonTracker, pulse: int) -> int | None:
        """Return whose a track was when it was first heard of again; None: nobody knows."""
        if people.is_known(track):
            self._found.setdefault(track, pulse)
        first = self._found.get(track)
        return None if first is None else people.person_of(track.camera, track.boot, track.track, first)


def first_free_number(said: IdentitySnapshot) -> int:
    """Return the first number that is and was never used; a camera's state may contradict itself."""
    return max([said.next_number, *(number + 1 for it in said.people for number in (it.number, *it.aliases))])


def trusted_first_free(firsts: Iterable[int]) -> int:
    """Return the highest first free number that is believed: one camera alone cannot raise it far.

    >>> believed([7, 5]), believed([900_000_000, 5]), believed([2_000_007, 2_000_005])
    (1000000, 1000000, 2010005)
    """
    _, other, *_ = [*sorted(firsts, reverse=True), 1, 1]
    return max(other + _NUMBER_SLACK, SINGLE_CAMERA_NUMBER_MAX)


def _awaited(said: dict[str, IdentitySnapshot]) -> list[_Awaited]:
    """Put together what the cameras remember: the newest word on somebody counts."""
    newest: dict[int, PersonSnapshot] = {}
    tracks: dict[int, set[TrackName]] = {}
    whose: dict[int, int] = {}
    """By an old number: who had it."""
    for camera, it in sorted(said.items(), key=lambda named: (named[1].pulse, named[0])):
        for known in it.people:
            newest[known.number] = known
            whose |= dict.fromkeys(known.aliases, known.number)
            theirs = tracks.setdefault(known.number, set())
            theirs |= {TrackName(camera, it.boot, track) for track in known.tracks}
    for old in sorted(whose.keys() & newest.keys()):  # some camera had not heard yet that two are one
        kept = whose[old]
        if kept != old and kept in newest:
            tracks[kept] |= tracks.pop(old)
            del newest[old]
    return [
        _Awaited(
            number=number,
            tracks=tuple(sorted(tracks[number], key=lambda it: (it.camera, it.boot, it.track))),
            also=tuple(old for old in known.aliases if whose[old] == number and old not in newest),
            name=known.name,
            by_hand=known.manual,
        )
        for number, known in sorted(newest.items())
    ]
