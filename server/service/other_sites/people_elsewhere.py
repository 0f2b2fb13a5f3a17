"""The people whom other sites see or have seen last, by what these sites say."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview import RemoteSighting
from bestview.association.appearance.histograms import MeanHistogram
from server.config.sections import LinkSettings
from server.messaging.packed_arrays import unpack_histograms
from server.messaging.site_people import (
    DIGEST_BYTES,
    PersonHistogram,
    SitePeople,
    TokenDigest,
    Viewers,
    unpack_population,
    unpack_sightings,
)

HEARD_S = 5.0
"""Seconds after its last message for which a site counts as there."""
SILENT_S = 30.0
"""Seconds after its last message after which those whom it saw count as having left."""
_RENUMBERED = 3
"""Messages in a row after which a site's numbers have begun anew."""
_REPEATED_S = 60.0
"""Seconds after which a site that is there has repeated everybody whom it has not forgotten."""


@dataclass(frozen=True, slots=True)
class PersonElsewhere:
    """A person whom another site has seen last.

    Attributes:
        number: theirs, at all sites.
        site: its name.
        camera: of that site.
        frame: of the last sighting, in this site's pulses.
        stay_s: seconds for which they had been there; None: they have left.
        heard_at: when the site said so, monotonic seconds.
    """

    number: int
    site: str
    camera: str
    frame: int
    stay_s: float | None
    heard_at: float

    def sighting(self, histogram: MeanHistogram | None = None) -> RemoteSighting:
        """Return it for the identity registry."""
        is_visible = self.stay_s is not None
        return RemoteSighting(self.number, self.site, self.camera, self.frame, is_visible, histogram)


@dataclass(slots=True)
class LinkedSite:
    """What is known about another site."""

    name: str
    settings: LinkSettings
    heard_at: float | None = None
    """Of its last message, monotonic seconds."""
    index: int = -1
    numbered_since: float | None = None
    is_missed: bool = False
    """Whether it was logged that nothing was heard of it."""
    refused: str = ""
    """Why its messages are not used; empty: they are."""
    viewers: Viewers = field(default_factory=Viewers)
    population: NDArray[np.float64] | None = None
    _begins_anew: int = 0
    """Messages in a row in which its numbers began at another time."""

    def has_renumbered(self, since: float) -> bool | None:
        """Return whether a site's numbers have begun anew; None: only if it says so several times in a row.

        For a moment two of a site's services may both lead, one of which has just started.
        """
        if self.numbered_since in {None, since}:
            self._begins_anew = 0
            return False
        self._begins_anew += 1
        return True if self._begins_anew >= _RENUMBERED else None

    def is_there(self, now: float, within: float = HEARD_S) -> bool:
        """Return whether it has been heard lately, and is not refused."""
        return not self.refused and self.heard_at is not None and now < self.heard_at + within

    def may_know(self, token_sha256: str | None, number: int) -> bool:
        """Return whether the site would tell the holder of a token that a person is there."""
        if self.viewers.is_open:
            return True
        if token_sha256 is None:
            return False
        digest = token_digest(self.viewers.salt, token_sha256)
        return any(token.digest == digest and token.object in {0, number} for token in self.viewers.tokens)


class PeopleElsewhere:
    """Everybody, by number; each at the site that has seen them last. At most ``most``, those seen last."""

    def __init__(self, most: int) -> None:
        self._most = most
        self.by_number: dict[int, PersonElsewhere] = {}

    def put(
        self, site: LinkedSite, message: SitePeople, pulse: int, fps: float, now: float
    ) -> Iterator[PersonElsewhere]:
        """Take a site's message at a pulse; yield whom it has seen last."""
        for sighting in unpack_sightings(message):
            known = self.by_number.get(sighting.number)
            frame = round(pulse - sighting.age_s * fps)
            person = PersonElsewhere(sighting.number, site.name, sighting.camera, frame, sighting.stay_s, now)
            if known is None or known.site == site.name or _is_later(person, known):
                self.by_number[sighting.number] = person
                yield person

    def histograms_of(
        self, site: LinkedSite, histograms: Iterable[PersonHistogram]
    ) -> dict[int, MeanHistogram]:
        """Return the mean histograms in a site's message by number, of those whom it has seen last."""
        return {
            each.number: MeanHistogram.of(unpack_histograms(each.histogram, 1)[0], each.frames)
            for each in histograms
            if each.number in self.by_number and self.by_number[each.number].site == site.name
        }

    def leave_silent_site(self, site: LinkedSite) -> list[PersonElsewhere]:
        """Let those whom a site saw count as having left; return them."""
        left = [
            PersonElsewhere(person.number, person.site, person.camera, person.frame, None, person.heard_at)
            for person in self.by_number.values()
            if person.site == site.name and person.stay_s is not None
        ]
        self.by_number |= {person.number: person for person in left}
        return left

    def drop(self, sites_there: Iterable[str], now: float) -> list[int]:
        """Drop whom sites that are there have forgotten, and who are too many; return their numbers."""
        there = set(sites_there)
        dropped = [
            person.number
            for person in self.by_number.values()
            if person.site in there and now > person.heard_at + _REPEATED_S
        ]
        kept = [person for number, person in self.by_number.items() if number not in set(dropped)]
        kept.sort(key=lambda person: (person.stay_s is None, -person.frame, person.number))
        dropped += [person.number for person in kept[self._most :]]
        for number in dropped:
            del self.by_number[number]
        return dropped

    def forget(self, numbers: Iterable[int]) -> None:
        """Forget people."""
        for number in numbers:
            self.by_number.pop(number, None)


def population_of(message: SitePeople) -> NDArray[np.float64] | None:
    """Return how a site's cameras render people; None: the message does not say."""
    if message.population is None or not message.population.histogram:
        return None
    return unpack_population(message.population)


def token_digest(salt: bytes, token_sha256: str) -> bytes:
    """Return what a site tells of a token that it accepts."""
    return hashlib.sha256(salt + token_sha256.encode()).digest()[:DIGEST_BYTES]


def viewers_of(salt: bytes, tokens: Iterable[tuple[str, int]]) -> Viewers:
    """Return who may know who is at a site: tokens' SHA-256 with the only person each is for, or 0."""
    digests = [TokenDigest(token_digest(salt, sha256), number) for sha256, number in tokens]
    return Viewers(salt=salt, tokens=digests)


def _is_later(person: PersonElsewhere, known: PersonElsewhere) -> bool:
    return (person.stay_s is not None, person.frame) > (known.stay_s is not None, known.frame)
