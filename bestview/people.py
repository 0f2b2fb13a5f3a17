"""Everybody known, numbered or not yet, and which track is whose."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.corrections import Merge
from bestview.evidence import PairEvidence, TrackKey
from bestview.identity_settings import IdentitySettings
from bestview.persons import Finding, Person

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
        self._heard: dict[TrackKey, int] = {}
        self._next_serial = 0
        self._next_number = 1

    def __len__(self) -> int:
        """Count everybody remembered, the unconfirmed too."""
        return len(self._persons)

    def meet(self, key: TrackKey, frame: int) -> None:
        """Hear of a track; a new one is a person of its own at first."""
        if key not in self._serial_of:
            self._serial_of[key] = self._new_serial()
        self._heard[key] = frame

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
        return sorted(key for key, heard in self._heard.items() if heard >= frame)

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
        """Carry out a grouping of the tracks of `pairs`: (T,) serials, unknown ones are new persons.

        A person all of whose present tracks went to another is that other person, unless tracks of the
        two were once seen side by side: then they have only left the picture.
        """
        before = self.serials(pairs.keys)
        serial: dict[int, int] = {}
        for given in grouped.tolist():
            serial.setdefault(given, given if given in self._persons else self._new_serial())
        after = np.array([serial[given] for given in grouped.tolist()], dtype=np.int64)
        for key, mine in zip(pairs.keys, after.tolist(), strict=True):
            self._serial_of[key] = mine
        emptied = [s for s in np.unique(before[present]).tolist() if not (after[present] == s).any()]
        merged = []
        for old in emptied:
            target, count = np.unique(after[present & (before == old)], return_counts=True)
            new = int(target[np.argmax(count)])
            if old != new and old in self._persons and new in self._persons:
                merged += self._unite(pairs, old, new)
        return tuple(merged)

    def _unite(self, pairs: PairEvidence, old: int, new: int) -> list[Merge]:
        serials = self.serials(pairs.keys)
        if pairs.rivals[np.ix_(serials == old, serials == new)].any():
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
        for key, serial in self._serial_of.items():
            if serial == lose:
                self._serial_of[key] = keep

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
        for key in [k for k, s in self._serial_of.items() if s in drop or self._heard[k] < stale]:
            self.person(key).tracks.pop(key, None)
            del self._serial_of[key], self._heard[key]
        self._persons = {serial: person for serial, person in self._persons.items() if serial not in drop}

    def _new_serial(self) -> int:
        serial = self._next_serial
        self._next_serial += 1
        self._persons[serial] = Person()
        return serial
