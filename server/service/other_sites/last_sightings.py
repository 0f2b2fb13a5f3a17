"""Where other sites have seen people last, by what these sites say."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from bestview import SiteSighting
from bestview.association.appearance.histograms import MeanHistogram
from server.messaging.packed_arrays import unpack_histograms
from server.messaging.site_people import PersonHistogram, SitePeople, unpack_sightings
from server.service.other_sites.linked_site import LinkedSite

_REPEATED_S = 60.0
"""Seconds after which a site that is there has repeated everybody whom it has not forgotten."""


@dataclass(frozen=True, slots=True)
class LastSighting:
    """Where another site has seen a person last.

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

    def for_registry(self, histogram: MeanHistogram | None = None) -> SiteSighting:
        """Return it as the identity registry takes it."""
        is_visible = self.stay_s is not None
        return SiteSighting(self.number, self.site, self.camera, self.frame, is_visible, histogram)


class LastSightings:
    """The last sighting of everybody, of all other sites; of ``most`` people at most, the newest."""

    def __init__(self, most: int) -> None:
        self._most = most
        self.by_number: dict[int, LastSighting] = {}
        """By the person's."""

    def put(
        self, site: LinkedSite, message: SitePeople, pulse: int, fps: float, now: float
    ) -> Iterator[LastSighting]:
        """Take a site's message at a pulse; yield the sightings of those whom it has seen last."""
        for row in unpack_sightings(message):
            known = self.by_number.get(row.number)
            frame = round(pulse - row.age_s * fps)
            sighting = LastSighting(row.number, site.name, row.camera, frame, row.stay_s, now)
            if known is None or known.site == site.name or _is_later(sighting, known):
                self.by_number[row.number] = sighting
                yield sighting

    def histograms_of(
        self, site: LinkedSite, histograms: Iterable[PersonHistogram]
    ) -> dict[int, MeanHistogram]:
        """Return the mean histograms in a site's message by number, of those whom it has seen last."""
        return {
            each.number: MeanHistogram.of(unpack_histograms(each.histogram, 1)[0], each.frames)
            for each in histograms
            if each.number in self.by_number and self.by_number[each.number].site == site.name
        }

    def leave_silent_site(self, site: LinkedSite) -> list[LastSighting]:
        """Let those whom a site saw count as having left; return their last sightings."""
        left = [
            replace(sighting, stay_s=None)
            for sighting in self.by_number.values()
            if sighting.site == site.name and sighting.stay_s is not None
        ]
        self.by_number |= {sighting.number: sighting for sighting in left}
        return left

    def drop(self, sites_there: Iterable[str], now: float) -> list[int]:
        """Drop whom sites that are there have forgotten, and who are too many; return their numbers."""
        there = set(sites_there)
        dropped = [
            sighting.number
            for sighting in self.by_number.values()
            if sighting.site in there and now > sighting.heard_at + _REPEATED_S
        ]
        kept = [sighting for number, sighting in self.by_number.items() if number not in set(dropped)]
        kept.sort(key=lambda sighting: (sighting.stay_s is None, -sighting.frame, sighting.number))
        dropped += [sighting.number for sighting in kept[self._most :]]
        for number in dropped:
            del self.by_number[number]
        return dropped

    def forget(self, numbers: Iterable[int]) -> None:
        """Forget people."""
        for number in numbers:
            self.by_number.pop(number, None)


def _is_later(sighting: LastSighting, known: LastSighting) -> bool:
    return (sighting.stay_s is not None, sighting.frame) > (known.stay_s is not None, known.frame)
