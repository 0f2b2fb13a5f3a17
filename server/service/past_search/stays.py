"""Stays: the times in which a person was somewhere, joined over short gaps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Place:
    """Where someone stays: an area, one camera's picture, or, with neither, anywhere on the site."""

    zone: str | None = None
    camera: str | None = None


@dataclass(frozen=True, slots=True)
class RecordedPerson:
    """A person's number in a run of the service; ``run`` is empty where numbers mean the same as now."""

    run: str
    number: int


@dataclass(frozen=True, slots=True)
class Stay:
    """A person's stay at a place in the pulses ``first … end - 1``, some of which may lie in short gaps."""

    person: RecordedPerson
    place: Place
    first: int
    end: int
    seen: Mapping[int, int]
    """By camera (its index), the number of samples in which it saw them there."""

    @property
    def frames(self) -> int:
        """Its length."""
        return self.end - self.first

    def joined_with(self, other: Stay) -> Stay:
        """Return both and the gap between them as one stay."""
        seen = dict(self.seen)
        for camera, samples in other.seen.items():
            seen[camera] = seen.get(camera, 0) + samples
        return Stay(self.person, self.place, min(self.first, other.first), max(self.end, other.end), seen)


class StayCollector:
    """Collects stays from samples, which are added in any order.

    Args:
        step: frames from one sample to the next; a sample stands for so many frames.
        gap: frames of absence at most between two sightings in one stay.
        current: merged numbers of the present run, with those that were kept.
    """

    def __init__(self, step: int, gap: int, current: Mapping[int, int]) -> None:
        self._step, self._gap = step, gap
        self._stays: list[Stay] = []
        self._kept = {
            RecordedPerson("", lost): RecordedPerson("", number) for lost, number in current.items()
        }

    def merge(self, run: str, kept: int, lost: int) -> None:
        """Count what is known of a number as another's, as an earlier run decided."""
        if kept != lost:
            self._kept[RecordedPerson(run, lost)] = RecordedPerson(run, kept)

    def add(self, run: str, place: Place, pulses: Ints, numbers: Ints, cameras: Ints) -> None:
        """Add N sightings at a place: pulse, person and camera of each, each (N,)."""
        if not len(pulses):
            return
        order = np.lexsort((pulses, numbers))
        pulses, numbers, cameras = pulses[order], numbers[order], cameras[order]
        longest = self._step + self._gap
        begins = (np.diff(numbers) != 0) | (np.diff(pulses) > longest)
        starts = np.flatnonzero(np.concatenate([[True], begins])).tolist()
        for start, stop in zip(starts, [*starts[1:], len(pulses)], strict=True):
            found, samples = np.unique(cameras[start:stop], return_counts=True)
            self._stays.append(
                Stay(
                    RecordedPerson(run, int(numbers[start])),
                    place,
                    int(pulses[start]),
                    int(pulses[stop - 1]) + self._step,
                    dict(zip(found.tolist(), samples.tolist(), strict=True)),
                )
            )

    def stays(self, shortest: int) -> list[Stay]:
        """Return the stays of at least ``shortest`` frames, of merged numbers as one person's."""
        groups: dict[tuple[RecordedPerson, Place], list[Stay]] = {}
        for stay in self._stays:
            person = self._resolve(stay.person)
            renamed = Stay(person, stay.place, stay.first, stay.end, stay.seen)
            groups.setdefault((person, stay.place), []).append(renamed)
        joined = (stay for group in groups.values() for stay in _join(group, self._gap))
        return [stay for stay in joined if stay.frames >= shortest]

    def _resolve(self, person: RecordedPerson) -> RecordedPerson:
        seen = {person}
        while (kept := self._kept.get(person)) is not None and kept not in seen:
            person = kept
            seen.add(person)
        return person


def _join(stays: Iterable[Stay], gap: int) -> list[Stay]:
    """Join stays of one person at one place that overlap, or have at most ``gap`` frames between them."""
    joined: list[Stay] = []
    for stay in sorted(stays, key=lambda stay: stay.first):
        if joined and stay.first - joined[-1].end <= gap:
            joined[-1] = joined[-1].joined_with(stay)
        else:
            joined.append(stay)
    return joined
