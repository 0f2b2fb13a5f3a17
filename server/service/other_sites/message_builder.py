"""Builds the messages to other sites: what has changed first, then the rest in turn."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import msgspec

from bestview.association.appearance.histograms import MeanHistogram
from server.config.site_config import Config
from server.messaging.packed_arrays import pack_histograms
from server.messaging.site_people import (
    DELETIONS_MAX,
    HISTOGRAMS_MAX,
    PEOPLE_MAX,
    PersonHistogram,
    SightingRow,
    SiteDeletion,
    SitePeople,
    Viewers,
    pack_reference_histogram,
    pack_sightings,
)
from server.service.identity.person_tracker import PersonTracker
from server.service.other_sites.people_here import PeopleHere, PersonHere

_HISTOGRAM_BYTES = 1 << 14
"""Bytes of histograms in a message, at most."""
_DELETIONS_BYTES = 1 << 13
"""Bytes of the newest deletions in a message, and of older ones, at most; one of any size fits."""
_HISTOGRAM_EVERY = 3
"""Messages after which the histogram of somebody who is here is sent again, if it is of more frames."""
_HISTOGRAM_GROWTH = 1.25
"""Factor by which their frames must have grown."""
_REPEATED = 10
"""People whose histograms are repeated in each message, though nothing is new."""
_VIEWERS_EVERY = 10
"""Messages between two lists of viewers, if none has changed."""


@dataclass(slots=True)
class _Sent:
    """What was sent about a person, and by which message: they themselves, and their histogram."""

    is_visible: bool
    at: int
    frames: int = 0
    histogram_at: int = -1
    """-1: never."""
    histogram_visible: bool = True
    """Whether they were here when their histogram was sent."""


class SiteMessageBuilder:
    """Builds the messages; each continues where the last one ended."""

    def __init__(self, config: Config, people: PersonTracker, here: PeopleHere) -> None:
        self._sites, self._fps = config.sites, config.site.fps
        self._people, self._here = people, here
        self._sent: dict[int, _Sent] = {}
        self._count = 0
        self._viewers: Viewers | None = None
        self._bins = 0
        self._next_older = 0
        """Where the next turn of older deletions begins."""

    def build(
        self,
        found: Sequence[PersonHere],
        pulse: int,
        numbered_since: float,
        deletions: Sequence[SiteDeletion],
        viewers: Viewers,
    ) -> bytes:
        """Return the next message, at a pulse.

        Args:
            found: everybody here.
            pulse: the newest.
            numbered_since: when this site's numbers began.
            deletions: all, the newest last.
            viewers: who may know who is here.
        """
        self._count += 1
        numbers = {person.number for person in found}
        self._sent = {number: sent for number, sent in self._sent.items() if number in numbers}
        sightings = [self._sighting(person, pulse) for person in self._next_people(found)]
        cameras = sorted({sighting.camera for sighting in sightings})
        histograms = self._next_histograms(found) if self._sites.share_looks else []
        reference = self._people.identity.reference_histogram(self._bins) if histograms else None
        is_due = viewers != self._viewers or self._count % _VIEWERS_EVERY == 1
        self._viewers = viewers
        return msgspec.msgpack.encode(
            SitePeople(
                index=self._sites.index,
                of=self._sites.of,
                numbered_since=numbered_since,
                cameras=cameras,
                people=pack_sightings(sightings, cameras),
                histograms=histograms,
                reference_histogram=None if reference is None else pack_reference_histogram(reference),
                deletions=self._next_deletions(deletions),
                viewers=viewers if is_due else None,
            )
        )

    def _next_people(self, found: Iterable[PersonHere]) -> list[PersonHere]:
        def priority(person: PersonHere) -> tuple[bool, int]:
            sent = self._sent.get(person.number)
            return (False, -1) if sent is None else (sent.is_visible == person.is_visible, sent.at)

        chosen = sorted(found, key=priority)[:PEOPLE_MAX]
        for person in chosen:
            sent = self._sent.setdefault(person.number, _Sent(person.is_visible, self._count))
            sent.is_visible, sent.at = person.is_visible, self._count
        return chosen

    def _sighting(self, person: PersonHere, pulse: int) -> SightingRow:
        arrived = self._here.arrived(person.number) if person.is_visible else None
        return SightingRow(
            person.number,
            person.camera,
            max(0, pulse - person.last_seen) / self._fps,
            None if arrived is None else max(0, pulse - arrived) / self._fps,
        )

    def _next_histograms(self, found: Iterable[PersonHere]) -> list[PersonHistogram]:
        """Return histograms that are new, or of people who have left since theirs was sent, and some more."""
        new: list[PersonHere] = []
        old: list[PersonHere] = []
        for person in found:
            sent = self._sent.get(person.number)
            if sent is None:
                continue
            has_left = sent.histogram_visible and not person.is_visible
            is_due = person.is_visible and self._count >= sent.histogram_at + _HISTOGRAM_EVERY
            (new if sent.histogram_at < 0 or has_left or is_due else old).append(person)

        def age(person: PersonHere) -> int:
            return self._sent[person.number].histogram_at

        chosen = [*sorted(new, key=age)[: 2 * HISTOGRAMS_MAX], *sorted(old, key=age)[:_REPEATED]]
        known = self._here.histograms(chosen)
        histograms: list[PersonHistogram] = []
        size = 0
        for person in chosen:
            histogram, sent = known.get(person.number), self._sent[person.number]
            if histogram is None:
                continue
            is_better = histogram.frame_count >= _HISTOGRAM_GROWTH * sent.frames or not person.is_visible
            if not is_better and person in new:
                continue
            histograms.append(_pack(person.number, histogram))
            size += len(histograms[-1].histogram)
            sent.frames, sent.histogram_at, sent.histogram_visible = (
                histogram.frame_count,
                self._count,
                person.is_visible,
            )
            self._bins = histogram.histogram_sum.size
            if len(histograms) == HISTOGRAMS_MAX or size > _HISTOGRAM_BYTES:
                break
        return histograms

    def _next_deletions(self, deletions: Sequence[SiteDeletion]) -> list[SiteDeletion]:
        """Return the newest ones, and the older ones in turn."""
        newest = _fitting(deletions[::-1])[::-1]
        older = deletions[: len(deletions) - len(newest)]
        begin = self._next_older % max(1, len(older))
        turn = _fitting([*older[begin:], *older[:begin]])
        self._next_older = begin + len(turn)
        return [*newest, *turn]


def _fitting(deletions: Sequence[SiteDeletion]) -> list[SiteDeletion]:
    """Return the first ones: half of those of a message, as far as their bytes fit."""
    fitting: list[SiteDeletion] = []
    size = 0
    for deletion in deletions[: DELETIONS_MAX // 2]:
        size += len(msgspec.msgpack.encode(deletion))
        if fitting and size > _DELETIONS_BYTES:
            break
        fitting.append(deletion)
    return fitting


def _pack(number: int, histogram: MeanHistogram) -> PersonHistogram:
    return PersonHistogram(
        number=number, frames=histogram.frame_count, histogram=pack_histograms(histogram.mean)
    )
