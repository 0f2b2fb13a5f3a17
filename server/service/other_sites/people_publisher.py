"""Publishes who is here to other sites, and which of their viewers may know it."""

from __future__ import annotations

import logging
import secrets
from collections.abc import Callable, Sequence

from server.config.site_config import Config
from server.messaging.site_people import (
    MESSAGE_BYTES_MAX,
    SALT_BYTES,
    VIEWERS_MAX,
    SiteDeletion,
    Viewers,
)
from server.service.bus_connection import BusConnection
from server.service.identity.person_tracker import PersonTracker
from server.service.other_sites.linked_site import viewers_of
from server.service.other_sites.message_builder import SiteMessageBuilder
from server.service.other_sites.people_here import PeopleHere, PersonHere

log = logging.getLogger(__name__)

Tokens = Sequence[tuple[str, int]]
"""SHA-256 of tokens, and the only person each is for, or 0."""


class PeoplePublisher:
    """Publishes messages about the people here.

    Attributes:
        accepted_tokens: returns the tokens of this site's viewers; None: it needs none. Not set: nobody may
            know who is here.
    """

    def __init__(self, config: Config, people: PersonTracker, here: PeopleHere, bus: BusConnection) -> None:
        self._bus = bus
        self._builder = SiteMessageBuilder(config, people, here)
        self._salt = secrets.token_bytes(SALT_BYTES)
        self.accepted_tokens: Callable[[], Tokens | None] | None = None
        self._has_been_too_long = False

    def publish(
        self,
        found: Sequence[PersonHere],
        pulse: int,
        numbered_since: float,
        deletions: Sequence[SiteDeletion],
    ) -> None:
        """Publish the next message, at a pulse; the arguments are those of `SiteMessageBuilder.build`."""
        payload = self._builder.build(found, pulse, numbered_since, deletions, self._viewers())
        if len(payload) <= MESSAGE_BYTES_MAX:
            self._bus.publish_people(payload)
        elif not self._has_been_too_long:
            self._has_been_too_long = True
            log.error("message to other sites dropped: %d bytes, at most %d", len(payload), MESSAGE_BYTES_MAX)

    def _viewers(self) -> Viewers:
        if self.accepted_tokens is None:
            return Viewers()
        tokens = self.accepted_tokens()
        return Viewers(is_open=True) if tokens is None else viewers_of(self._salt, tokens[:VIEWERS_MAX])
