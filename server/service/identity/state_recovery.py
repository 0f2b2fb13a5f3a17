"""Recovery of person numbers after a restart, from the snapshots that the cameras keep."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from itertools import chain
from math import inf

from bestview import SINGLE_SITE, IdSeries
from server.messaging.camera_identity_snapshot import (
    ALIASES_MAX,
    FORGOTTEN_MAX,
    PERSON_NUMBER_MAX,
    CameraIdentitySnapshot,
    PersonSnapshot,
)
from server.service.identity.local_numbers import TrackName
from server.service.identity.person_tracker import PersonTracker

SINGLE_CAMERA_NUMBER_MAX = 1_000_000
"""The largest first free number that is accepted from a single camera; another must confirm larger ones."""
_NUMBER_SLACK = 10_000
"""Numbers by which the newest snapshot may be ahead of the one before: far more than a second's."""
RECENT_S = 10.0
"""Tracks reported this recently are replicated: a camera on a busy machine reports late."""
MAX_DOWNTIME_S = 30.0
"""The longest downtime that tracks are recovered after: in more time a track may have switched people."""


def state_for_cameras(
    people: PersonTracker,
    cameras: Iterable[str],
    pulse: int,
    recent: int,
    since: float,
    forgotten: Iterable[int] = (),
) -> dict[str, CameraIdentitySnapshot]:
    """Build the snapshot for each camera: the people it tracked recently, and the first free number.

    ``forgotten`` are the numbers of people whose data were deleted, the newest last.
    """
    gone = [number for number in forgotten if number <= PERSON_NUMBER_MAX][-FORGOTTEN_MAX:]
    tracks_by_number = people.tracks_of(people.registry.all_numbers, pulse - recent)
    boots: dict[str, int] = {}
    for track in chain.from_iterable(tracks_by_number.values()):
        boots[track.camera] = max(track.boot, boots.get(track.camera, 0))
    former: dict[int, list[int]] = {}
    for old, number in people.registry.merged.items():
        if old <= PERSON_NUMBER_MAX:
            former.setdefault(number, []).append(old)
    manual = set(people.overrides.merged.values())
    known: dict[str, list[PersonSnapshot]] = {camera: [] for camera in cameras}
    for number, tracks in tracks_by_number.items():
        if number > PERSON_NUMBER_MAX:
            continue
        camera_tracks: dict[str, list[int]] = {}
        for track in tracks:
            if track.boot == boots[track.camera]:  # tracks of an earlier run of the camera have ended
                camera_tracks.setdefault(track.camera, []).append(track.track)
        aliases, name = former.get(number, [])[-ALIASES_MAX:], people.registry.names.get(number, "")
        is_manual = number in manual
        for camera, local_ids in camera_tracks.items():
            known[camera].append(
                PersonSnapshot(number=number, tracks=local_ids, aliases=aliases, name=name, manual=is_manual)
            )
    next_number = min(people.identity.next_id, PERSON_NUMBER_MAX + 1)
    return {
        camera: CameraIdentitySnapshot(
            pulse=pulse,
            boot=boots.get(camera, 0),
            next_number=next_number,
            numbered_since=since,
            people=people_of_camera,
            forgotten=gone,
        )
        for camera, people_of_camera in known.items()
    }


@dataclass(frozen=True, slots=True)
class _PendingPerson:
    """A person to recover, and their tracks in all cameras."""

    number: int
    tracks: tuple[TrackName, ...]
    former: tuple[int, ...]
    name: str
    manual: bool


class StateRecovery:
    """Restores people's numbers and manual overrides after a restart, as their tracks reappear.

    Args:
        snapshots: each camera's snapshot; those older than ``max_downtime`` only reserve numbers.
        pulse: the first pulse of this run.
        max_downtime: the longest downtime, in frames.
        ids: the numbers that this site assigns.
    """

    def __init__(
        self,
        snapshots: dict[str, CameraIdentitySnapshot],
        pulse: int,
        max_downtime: int,
        ids: IdSeries = SINGLE_SITE,
    ) -> None:
        self._until = -1
        self._has_ended = False
        self._tracks: dict[TrackName, int] = {}
        self._pending: list[_PendingPerson] = []
        self._reappeared_at: dict[TrackName, int] = {}
        """The pulse at which each track reappeared."""
        firsts = (first_free_number(snapshot, ids) for snapshot in snapshots.values())
        self.next_number = max(firsts, default=1)
        """The first number to assign in this run, whatever the downtime."""
        recent = {
            camera: snapshot
            for camera, snapshot in snapshots.items()
            if snapshot.pulse < pulse <= snapshot.pulse + max_downtime
        }
        # Recent snapshots agree; the median keeps a single deviating camera from deciding.
        since = sorted(snapshot.numbered_since for snapshot in recent.values())
        self.numbered_since = (
            since[len(since) // 2]
            if since
            else max((snapshot.numbered_since for snapshot in snapshots.values()), default=inf)
        )
        """When numbering began, unix seconds; infinite: unknown."""
        if recent:
            self._until = max(snapshot.pulse for snapshot in recent.values()) + max_downtime
            self._pending = _combine_snapshots(recent)
            self._tracks = {track: person.number for person in self._pending for track in person.tracks}

    @property
    def has_ended(self) -> bool:
        """Whether recovery has ended: no more tracks are recovered."""
        return self._has_ended

    @property
    def numbers(self) -> Collection[int]:
        """The numbers of the people still to be recovered, merged ones included."""
        return {number for person in self._pending for number in (person.number, *person.former)}

    def forget(self, numbers: Collection[int]) -> None:
        """Recover these people no longer."""
        gone = set(numbers)
        self._pending = [
            person for person in self._pending if gone.isdisjoint([person.number, *person.former])
        ]
        self._tracks = {track: number for track, number in self._tracks.items() if number not in gone}

    def begin(self, people: PersonTracker, pulse: int) -> None:
        """Assign the pending tracks to their people before any of them is reported."""
        people.identity.reserve_below(self.next_number)
        people.expect(self._tracks, pulse - 1)

    def advance(self, people: PersonTracker, pulse: int) -> None:
        """Recover people whose tracks have reappeared, after the epoch that ends with a pulse."""
        if pulse > self._until:
            self._pending, self._has_ended = [], True
            people.expected.cancel(self._tracks)
        self._pending = [person for person in self._pending if not self._restore(person, people, pulse)]

    def _restore(self, pending: _PendingPerson, people: PersonTracker, pulse: int) -> bool:
        """Restore a reappeared person's name and merges; return whether nothing is left to restore."""
        found_numbers = [self._number(track, people, pulse) for track in pending.tracks]
        numbers = sorted({number for number in found_numbers if number is not None})
        if not numbers:
            return False
        kept = pending.number if pending.number in numbers else numbers[0]
        if pending.name and kept not in people.registry.names:
            people.registry.set_name(kept, pending.name)
        people.registry.add_aliases(kept, pending.former)
        for merged in numbers if pending.manual else ():
            if merged != kept:
                people.merge(kept, merged)
        return not pending.manual or None not in found_numbers

    def _number(self, track: TrackName, people: PersonTracker, pulse: int) -> int | None:
        """Return a track's person number when it reappeared; None: it has not, or is not confirmed."""
        if people.is_known(track):
            self._reappeared_at.setdefault(track, pulse)
        first = self._reappeared_at.get(track)
        return None if first is None else people.person_of(track.camera, track.boot, track.track, first)


def first_free_number(snapshot: CameraIdentitySnapshot, ids: IdSeries = SINGLE_SITE) -> int:
    """Return the site's first unused number by a snapshot, which may contradict itself."""
    numbers = (number for person in snapshot.people for number in (person.number, *person.aliases))
    return max([snapshot.next_number, *(number + 1 for number in numbers if ids.has(number))])


def trusted_first_free(firsts: Iterable[int]) -> int:
    """Return the highest first free number that is trusted: one camera alone cannot raise it far.

    >>> trusted_first_free([7, 5]), trusted_first_free([900_000_000, 5])
    (1000000, 1000000)
    >>> trusted_first_free([2_000_007, 2_000_005])
    2010005
    """
    _, other, *_ = [*sorted(firsts, reverse=True), 1, 1]
    return max(other + _NUMBER_SLACK, SINGLE_CAMERA_NUMBER_MAX)


def _combine_snapshots(snapshots: dict[str, CameraIdentitySnapshot]) -> list[_PendingPerson]:
    """Combine the cameras' snapshots; of a person, the newest counts."""
    newest: dict[int, PersonSnapshot] = {}
    tracks: dict[int, set[TrackName]] = {}
    kept_number: dict[int, int] = {}
    """By merged number: the number that was kept."""
    for camera, snapshot in sorted(snapshots.items(), key=lambda named: (named[1].pulse, named[0])):
        for known in snapshot.people:
            newest[known.number] = known
            kept_number |= dict.fromkeys(known.aliases, known.number)
            person_tracks = tracks.setdefault(known.number, set())
            person_tracks |= {TrackName(camera, snapshot.boot, track) for track in known.tracks}
    for old in sorted(kept_number.keys() & newest.keys()):  # a camera's snapshot was older than a merge
        kept = kept_number[old]
        if kept != old and kept in newest:
            tracks[kept] |= tracks.pop(old)
            del newest[old]
    return [
        _PendingPerson(
            number=number,
            tracks=tuple(sorted(tracks[number], key=lambda track: (track.camera, track.boot, track.track))),
            former=tuple(old for old in known.aliases if kept_number[old] == number and old not in newest),
            name=known.name,
            manual=known.manual,
        )
        for number, known in sorted(newest.items())
    ]
