"""Everybody known, numbered or not yet, and which track is whose."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from bestview.corrections import Merge
from bestview.evidence import PairEvidence, TrackKey
from bestview.finding import Finding
from bestview.identity_settings import IdentitySettings
from bestview.persons import Person

_TENURE_UPDATES = 10.0
"""Updates after which a track has half of the extra hold that rooted tracks have."""

_TENURE_SHARE = 0.25
"""That extra hold: enough to say which of two goes, too little to keep what should go."""


class People:
    """The persons by an internal serial number, and the serial number of each track's person."""

    def __init__(self, settings: IdentitySettings) -> None:
        self._settings = settings
        self._persons: dict[int, Person] = {}
        self._serial_of: dict[TrackKey, int] = {}
        self._tracks_of: dict[int, set[TrackKey]] = {}
        # In the order in which they were heard of last: who was not for long comes first.
        self._heard: dict[TrackKey, int] = {}
        self._next_serial = 0
        self._next_number = 1

    def __len__(self) -> int:
        """Count everybody remembered, the unconfirmed too."""
        return len(self._persons)

    def meet(self, key: TrackKey, frame: int) -> None:
        """Hear of a track; a new one is a person of its own at first."""
        if key not in self._serial_of:
            self._assign(key, self._new_serial())
        self._heard.pop(key, None)
        self._heard[key] = frame

    def _assign(self, key: TrackKey, serial: int) -> None:
        before = self._serial_of.get(key)
        if before is not None:
            self._tracks_of[before].discard(key)
        self._serial_of[key] = serial
        self._tracks_of[serial].add(key)

    def person(self, key: TrackKey) -> Person:
        """Whose track it is."""
        return self._persons[self._serial_of[key]]

    def serials(self, keys: Sequence[TrackKey]) -> NDArray[np.int64]:
        """Give the internal number of each track's person: (T,)."""
        return np.array([self._serial_of[key] for key in keys], dtype=np.int64)

    @property
    def tracks(self) -> Collection[TrackKey]:
        """All tracks remembered."""
        return self._heard.keys()

    def tracks_heard_since(self, frame: int) -> list[TrackKey]:
        """List the tracks heard of since `frame`, sorted."""
        return sorted(takewhile(lambda key: self._heard[key] >= frame, reversed(self._heard)))

    def hold(self, key: TrackKey) -> float:
        """How firmly a track sits in its person: who came last is the first to go."""
        person = self.person(key)
        if not person.number:
            return 0.0
        tenure = person.tracks.get(key, 0)
        return self._settings.hold * (1.0 + _TENURE_SHARE * tenure / (tenure + _TENURE_UPDATES))

    def regroup(
        self, pairs: PairEvidence, grouped: NDArray[np.int64], present: NDArray[np.bool_]
    ) -> tuple[Merge, ...]:
        """Carry out a grouping of the tracks of `pairs`: (T,) serials; those nobody had are new persons.

        A person all of whose present tracks went to another is that other person, unless tracks of the
        two were once seen side by side: then they have only left the picture.
        """
        before = self.serials(pairs.keys)
        after = grouped.copy()
        # New ones count on in the order of their first tracks. They may have a serial that somebody has who
        # is remembered without a track here.
        new, first = np.unique(np.where(np.isin(grouped, before), -1, grouped), return_index=True)
        for given in new[np.argsort(first)].tolist():
            if given >= 0:
                after[grouped == given] = self._new_serial()
        for row in np.flatnonzero(after != before).tolist():
            self._assign(pairs.keys[row], int(after[row]))
        emptied = np.setdiff1d(before[present], after[present]).tolist()
        merged = []
        for old in emptied:
            targets, count = np.unique(after[present & (before == old)], return_counts=True)
            target = int(targets[np.argmax(count)])
            if old != target and old in self._persons and target in self._persons:
                merged += self._unite(pairs, old, target)
        return tuple(merged)

    def _unite(self, pairs: PairEvidence, old: int, new: int) -> list[Merge]:
        tracks = [pairs.in_play(self._tracks_of[serial]) for serial in (old, new)]
        if pairs.rivals.any_between(*tracks):
            return []
        # The lower number is the one people have known for longer.
        one, two = self._persons[old], self._persons[new]
        first = (one.number or np.inf, old) < (two.number or np.inf, new)
        keep, lose = (old, new) if first else (new, old)
        kept, lost = self._persons[keep], self._persons[lose]
        self._absorb(keep, lose)
        return [Merge(kept.number, lost.number)] if lost.number else []

    def _absorb(self, keep: int, lose: int) -> None:
        self._persons[keep].absorb(self._persons.pop(lose))
        for key in sorted(self._tracks_of[lose]):
            self._assign(key, keep)
        del self._tracks_of[lose]

    def confirm(self, finding: Finding, since: int) -> tuple[list[int], list[int]]:
        """Number those seen often enough: a new number, or that of the lost person they are.

        Args:
            finding: how people are found again.
            since: people not seen after this frame are lost.

        Returns:
            Numbers given for the first time, and numbers of people said to be gone who are back.
        """
        new = [
            serial
            for serial, person in self._persons.items()
            if not person.number and person.updates >= self._settings.confirm_updates
        ]
        new.sort(key=lambda serial: (self._persons[serial].first_frame, serial))
        lost = [serial for serial, p in sorted(self._persons.items()) if p.number and p.last_frame <= since]
        matches = finding.match([self._persons[s] for s in new], [self._persons[s] for s in lost])
        born, back = [], []
        for serial, match in zip(new, matches, strict=True):
            if match < 0:
                self._persons[serial].number = self._next_number
                born.append(self._next_number)
                self._next_number += 1
                continue
            person = self._persons[lost[match]]
            self._absorb(lost[match], serial)
            if person.gone:
                person.gone = False
                back.append(person.number)
        return born, back

    def comings_and_goings(self, frame: int) -> tuple[list[int], list[int]]:
        """Say whom no camera has seen for a while, and who of those is back: (gone, returned) numbers."""
        gone: list[int] = []
        returned: list[int] = []
        for person in self._persons.values():
            away = frame - person.last_frame > self._settings.gone_after
            if person.number and away != person.gone:
                (gone if away else returned).append(person.number)
                person.gone = away
        return gone, returned

    def forget(self, frame: int) -> None:
        """Forget whoever was gone for too long, and tracks that were never somebody."""
        settings = self._settings
        gone = sorted((p.last_frame, s) for s, p in self._persons.items() if p.gone)
        surplus = len(gone) - settings.remember
        drop = {s for i, (last, s) in enumerate(gone) if i < surplus or frame - last > settings.forget_after}
        drop |= {
            serial
            for serial, person in self._persons.items()
            if not person.number and frame - person.last_frame > settings.gone_after
        }
        stale = frame - settings.forget_after
        tracks = [key for serial in sorted(drop) for key in sorted(self._tracks_of[serial])]
        tracks += list(takewhile(lambda key: self._heard[key] < stale, self._heard))
        for key in dict.fromkeys(tracks):
            self.person(key).tracks.pop(key, None)
            self._tracks_of[self._serial_of.pop(key)].discard(key)
            del self._heard[key]
        for serial in drop:
            del self._persons[serial], self._tracks_of[serial]

    def _new_serial(self) -> int:
        serial = self._next_serial
        self._next_serial += 1
        self._persons[serial] = Person()
        self._tracks_of[serial] = set()
        return serial
