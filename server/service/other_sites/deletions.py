"""Deletions between sites: who is deleted at one is deleted at all, also at one that was cut off then."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from bestview import IdSeries
from server.messaging.service_record import DeletedPerson
from server.messaging.site_people import SiteDeletion
from server.service.other_sites.numbering_ledger import NumberingLedger

_KEPT = 1000
"""Deletions that are repeated to other sites, the newest."""


class SiteDeletions:
    """Translates between this site's deletions and those that sites tell each other.

    This site's are of all numbers of one of its numberings, whoever has assigned them; between sites, numbers
    go with the site that has assigned them, and since when its numbers are.
    """

    def __init__(self, ids: IdSeries, ledger: NumberingLedger) -> None:
        self._ids, self._ledger = ids, ledger
        self._known: list[DeletedPerson] = []

    def add(self, deletion: DeletedPerson) -> None:
        """Add a deletion of this site, to be published."""
        if deletion not in self._known:
            self._known = [*self._known, deletion][-_KEPT:]

    def to_publish(self, forgotten: Iterable[int], own_since: float) -> list[SiteDeletion]:
        """Return what to publish; ``forgotten``: numbers whose deletion only cameras remember."""
        known = {number for each in self._known if each.numbers_since == own_since for number in each.numbers}
        rest = [number for number in forgotten if number not in known]
        of_cameras = [
            each
            for number in rest
            for each in self._split(
                DeletedPerson(numbers=[number], numbers_since=own_since, deletes_media=False)
            )
        ]
        return [*of_cameras, *(each for deletion in self._known for each in self._split(deletion))]

    def _split(self, deletion: DeletedPerson) -> Iterable[SiteDeletion]:
        by_index: dict[int, list[int]] = {}
        for number in deletion.numbers:
            by_index.setdefault((number - 1) % self._ids.step, []).append(number)
        for index, numbers in sorted(by_index.items()):
            own = deletion.numbers_since
            for since in [own] if index == self._ids.index else self._ledger.numberings(own, index):
                yield SiteDeletion(
                    index=index,
                    numbered_since=since,
                    numbers=numbers,
                    deletes_media=deletion.deletes_media,
                )

    def to_own(
        self, received: SiteDeletion, with_merged: Callable[[list[int], float], list[int]]
    ) -> Iterable[DeletedPerson]:
        """Return the deletions of this site that follow from one at another site.

        ``with_merged`` adds to numbers those that are now one person with them, in a numbering of this site.
        """
        index, since = received.index, received.numbered_since
        if any((number - 1) % self._ids.step != index for number in received.numbers):
            return
        numberings = [since] if index == self._ids.index else self._ledger.own_numberings(index, since)
        for own_since in numberings:
            yield DeletedPerson(
                numbers=with_merged(received.numbers, own_since),
                numbers_since=own_since,
                deletes_media=received.deletes_media,
            )
