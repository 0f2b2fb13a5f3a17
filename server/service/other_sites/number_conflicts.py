"""Conflicts about numbers: two sites that say that they see one person now, who then gets two numbers."""

from __future__ import annotations

import logging

from server.config.site_config import Config
from server.service.identity.person_tracker import PersonTracker
from server.service.other_sites.last_sightings import LastSighting
from server.service.other_sites.linked_site import LinkedSite
from server.service.other_sites.people_here import PeopleHere

log = logging.getLogger(__name__)

_STAY_MARGIN_S = 2.0
"""Seconds by which two sites' times of arrival may be wrong."""
_REPEATED = 2
"""Messages in a row that say a person is at another site while they are here, before one is renumbered."""


class NumberConflicts:
    """Finds people who are at another site, too; where they arrived later they get a new number."""

    def __init__(self, config: Config, people: PersonTracker, here: PeopleHere) -> None:
        self._config, self._people, self._here = config, people, here
        self._messages: dict[int, int] = {}
        """By number, messages in a row that say a person is at another site, too."""

    def check(self, site: LinkedSite, sighting: LastSighting, *, leads: bool) -> bool:
        """Return whether whom a site says it sees is here, too; the leading service may renumber them."""
        number = self._people.registry.current(sighting.number)
        arrived = self._here.arrived(number)
        if sighting.stay_s is None or arrived is None:
            self._messages.pop(number, None)
            return False
        self._messages[number] = self._messages.get(number, 0) + 1
        stay_s = (self._people.newest - arrived) / self._config.site.fps
        longer_s = sighting.stay_s - stay_s
        arrived_later = longer_s > _STAY_MARGIN_S or (
            longer_s >= -_STAY_MARGIN_S and site.index < self._config.sites.index
        )
        if arrived_later and self._messages[number] >= _REPEATED and leads:
            self._renumber(number)
        return True

    def _renumber(self, number: int) -> None:
        new = self._people.split_off(number, self._config.camera_ids)
        self._messages.pop(number, None)
        if new is not None:
            log.warning("person %d is at another site: who is here is now %d", number, new)
