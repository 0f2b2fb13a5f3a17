"""Finds two people who were taken for each other when they met, by their appearance before and after.

The program decides who is who within a window, and while people stand together their boxes and histograms are
mixed. Once they have parted, each is seen alone for as long as it takes: then their appearance is compared
with that before they met.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from tracking.appearance import appearance_distance_matrix
from tracking.boxes import Floats
from tracking.ground_plane.places.hypotheses import Places

_NEAR_M = 1.7
"""Meters between two people from which they can be taken for each other."""
_JUDGED_AFTER_S, _GIVEN_UP_AFTER_S = 1.0, 4.0
"""Seconds since they parted from which they are compared, and until which."""
_MIN_SIGHTINGS = 3
"""Sightings of a person in a camera that count: a single one may show somebody else."""
_EXCHANGED, _CLEARLY_NOT = -0.12, 0.12
"""Sums of both people's mean evidence up to which they were exchanged, and from which they were not."""
_MEMORY = 30.0
"""Sightings over which a person's appearance is averaged."""

Pair = tuple[int, int]
"""Ids of two people, the lower one first."""


@dataclass(frozen=True, slots=True, eq=False)
class ClearSighting:
    """A person in a camera's picture, more likely than not."""

    camera: int
    histogram: Floats


@dataclass(frozen=True, slots=True, eq=False)
class PersonInFrame:
    """A person in a frame.

    Attributes:
        id: of the track.
        place: (2,) meters.
        sightings: empty if no camera sees the person clearly.
    """

    id: int
    place: Floats
    sightings: Sequence[ClearSighting]


@dataclass(slots=True, eq=False)
class _Meeting:
    """Two people who are, or were, near each other.

    Attributes:
        before: by person, the appearance before they met.
        parted_s: seconds since they parted.
        evidence: by person and camera, by how much less each sighting since resembles the other.
    """

    before: Mapping[int, Mapping[int, Floats]]
    parted_s: float = 0.0
    evidence: dict[tuple[int, int], list[float]] = field(default_factory=dict)

    def resume(self) -> None:
        """Begin to compare anew: they are near each other again, or one of them was somebody else."""
        self.parted_s, self.evidence = 0.0, {}

    def compare(self, person: PersonInFrame, other: int) -> None:
        """Compare a person's sightings with the appearance of both."""
        for sighting in person.sightings:
            own, others = (self.before[number].get(sighting.camera) for number in (person.id, other))
            if own is None or others is None or not len(own) == len(others) == len(sighting.histogram):
                continue
            distances = appearance_distance_matrix(np.stack([own, others]), sighting.histogram[None])[:, 0]
            seen = self.evidence.setdefault((person.id, sighting.camera), [])
            seen.append(float(distances[1] - distances[0]))

    def score(self) -> float:
        """Return the sum of both people's mean evidence, below 0 if exchanged; 0: not known."""
        means: dict[int, list[float]] = {}
        for (person, _), found in self.evidence.items():
            if len(found) >= _MIN_SIGHTINGS:
                means.setdefault(person, []).append(float(np.mean(found)))
        return (
            sum(float(np.mean(found)) for found in means.values()) if len(means) == len(self.before) else 0.0
        )


class _SoloAppearance:
    """A person's appearance by camera: the mean of the sightings while nobody else was near."""

    def __init__(self) -> None:
        self._means: dict[int, Floats] = {}
        self._counts: Counter[int] = Counter()

    def learn(self, sightings: Sequence[ClearSighting]) -> None:
        """Add the sightings of a frame."""
        for camera, histogram in ((sighting.camera, sighting.histogram) for sighting in sightings):
            known = self._means.get(camera, histogram)
            if len(known) != len(histogram) or not len(histogram):
                continue
            self._counts[camera] += 1
            rate = 1.0 / min(self._counts[camera], _MEMORY)
            self._means[camera] = known + rate * (histogram - known)

    def by_camera(self) -> dict[int, Floats]:
        """Return the mean histograms known."""
        return dict(self._means)


class ExchangeMonitor:
    """Watches people meet and part; frames are `seconds` apart."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._appearances: dict[int, _SoloAppearance] = {}
        self._meetings: dict[Pair, _Meeting] = {}

    def update(self, people: Sequence[PersonInFrame], known: Collection[int]) -> list[Pair]:
        """Add a frame; return the pairs of ids that have been exchanged, each id in one at most.

        From then on, their ids are taken to have been exchanged back. `known`: the ids of everybody who has
        not left, also of those who are hidden in this frame.
        """
        found = {person.id: person for person in people}
        self._appearances = {number: self._appearances.get(number, _SoloAppearance()) for number in known}
        self._meetings = {
            pair: each for pair, each in self._meetings.items() if self._appearances.keys() >= set(pair)
        }
        near = dict.fromkeys(_near(people))
        exchanged, moved = list[Pair](), set[int]()
        parted = [pair for pair in self._meetings if pair not in near and found.keys() >= set(pair)]
        for pair in parted:
            if moved.isdisjoint(pair) and self._were_exchanged(pair, found):
                exchanged.append(pair)
                moved.update(pair)
        for pair, meeting in self._meetings.items():
            if not moved.isdisjoint(pair):
                meeting.resume()
        for pair in near:
            if pair in self._meetings:
                self._meetings[pair].resume()
            else:
                self._meetings[pair] = _Meeting(
                    {number: self._appearances[number].by_camera() for number in pair}
                )
        unsure = {number for pair in self._meetings for number in pair}
        for number in found.keys() - unsure:
            self._appearances[number].learn(found[number].sightings)
        return exchanged

    def clear(self) -> None:
        """Forget all."""
        self._appearances, self._meetings = {}, {}

    def _were_exchanged(self, pair: Pair, found: Mapping[int, PersonInFrame]) -> bool:
        """Compare two people who have parted with before; the meeting ends when it is clear."""
        meeting = self._meetings[pair]
        meeting.parted_s += self._seconds
        for person, other in (pair, pair[::-1]):
            meeting.compare(found[person], other)
        if meeting.parted_s < _JUDGED_AFTER_S:
            return False
        score = meeting.score()
        if _EXCHANGED < score < _CLEARLY_NOT and meeting.parted_s < _GIVEN_UP_AFTER_S:
            return False
        del self._meetings[pair]
        return score <= _EXCHANGED


def clear_sightings(places: Places, k: int) -> list[ClearSighting]:
    """Return the detections of place `k`, below 0: none, that are more likely of a person than not."""
    measurements = places.measurements
    return [
        ClearSighting(int(measurements.camera[index]), measurements.histograms[index])
        for index in (places.groups[k] if k >= 0 else ())
        if measurements.log_odds[index] > 0.0
    ]


def _near(people: Sequence[PersonInFrame]) -> list[Pair]:
    """Return the pairs of people who are near each other, the lower id first."""
    ordered = sorted(people, key=lambda person: person.id)
    places = np.array([person.place for person in ordered]).reshape(-1, 2)
    distances = np.linalg.norm(places[:, None] - places[None], axis=2)
    pairs = np.argwhere(np.triu(distances < _NEAR_M, 1)).tolist()
    return [(ordered[one].id, ordered[two].id) for one, two in pairs]
