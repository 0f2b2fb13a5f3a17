"""Where two services' records differ about who is who, and how one follows the other."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from server.messaging.camera_identity_snapshot import CameraIdentitySnapshot
from server.service.identity.local_numbers import TrackName
from server.service.identity.person_tracker import PersonTracker

Snapshots = Mapping[str, CameraIdentitySnapshot]
"""By camera."""


@dataclass(frozen=True, slots=True)
class Disagreements:
    """What a service changes to follow another.

    Attributes:
        renumbered: by number, the other's number of the same person.
        merged: by number, the number of the person that the other says it is.
        split: by number, the cameras whose tracks the other says are somebody else, and who.
    """

    renumbered: Mapping[int, int] = field(default_factory=dict)
    merged: Mapping[int, int] = field(default_factory=dict)
    split: Mapping[int, tuple[tuple[str, ...], int]] = field(default_factory=dict)

    def common(self, other: Disagreements) -> Disagreements:
        """Return what is the same in another comparison."""
        return Disagreements(
            dict(self.renumbered.items() & other.renumbered.items()),
            dict(self.merged.items() & other.merged.items()),
            dict(self.split.items() & other.split.items()),
        )

    def __bool__(self) -> bool:
        """Return whether there are any."""
        return bool(self.renumbered or self.merged or self.split)


def numbers_of_tracks(snapshots: Snapshots, without: Collection[int] = ()) -> dict[TrackName, int]:
    """Return the person number of each track, except for those of some people."""
    return {
        TrackName(camera, snapshot.boot, track): person.number
        for camera, snapshot in snapshots.items()
        for person in snapshot.people
        if person.number not in without
        for track in person.tracks
    }


def find_disagreements(own: Mapping[TrackName, int], leading: Mapping[TrackName, int]) -> Disagreements:
    """Compare who the tracks are in two records of one pulse, by those that both have.

    A person is renumbered where all of their tracks have other numbers in the leading record; of several the
    most frequent, then the lowest. They are merged into another where that number is somebody's whom the
    leading record has with the same number. Where only some of the tracks differ, these are split off.
    """
    common = sorted(own.keys() & leading.keys(), key=lambda track: (track.camera, track.track))
    wanted: dict[int, Counter[int]] = defaultdict(Counter)
    cameras: dict[tuple[int, int], set[str]] = defaultdict(set)
    for track in common:
        number, other = own[track], leading[track]
        wanted[number][other] += 1
        cameras[number, other].add(track.camera)
    agreed = {number for number, votes in wanted.items() if votes[number]}
    renumbered: dict[int, int] = {}
    merged: dict[int, int] = {}
    split: dict[int, tuple[tuple[str, ...], int]] = {}
    for number, votes in sorted(wanted.items()):
        other = min(votes, key=lambda candidate: (candidate != number, -votes[candidate], candidate))
        if other != number and other in agreed:
            merged[number] = other
        elif other != number and other not in renumbered.values():
            renumbered[number] = other
        for strange in sorted(votes.keys() - {other}):
            split.setdefault(number, (tuple(sorted(cameras[number, strange])), strange))
    return Disagreements(renumbered, merged, split)


def follow(people: PersonTracker, found: Disagreements) -> None:
    """Change people's numbers to those of the leading service."""
    for number, (cameras, other) in found.split.items():
        new = people.split_off(number, cameras)
        if new is not None:
            _rename(people, {new: other})
    for number, other in found.merged.items():
        if {number, other} <= people.registry.first_seen.keys():
            people.merge(other, number)
    _rename(people, found.renumbered)


def _rename(people: PersonTracker, wanted: Mapping[int, int]) -> None:
    """Renumber people; whoever has a number that is given to somebody else gets theirs."""
    known = people.registry.first_seen
    numbers = {old: new for old, new in wanted.items() if old in known}
    for old, new in list(numbers.items()):
        if new in known and new not in numbers:
            if new in people.registry.departed:
                people.merge(new, old)  # the leading service has recognized a person who was away
                del numbers[old]
                continue
            free = sorted(set(numbers) - set(numbers.values()))
            numbers[new] = free[0]
    if numbers:
        people.renumber(numbers)
