"""Reads a site's state for MQTT from the façade of the service."""

from __future__ import annotations

from server.integrations.mqtt.site_state import (
    PublishedCamera,
    PublishedPerson,
    PublishedRule,
    SiteState,
    person_key,
)
from server.service.facade.people import PersonSummary
from server.service.facade.rendering import PersonView, PictureTimeoutError, RenderPoolFullError
from server.service.service import BestViewService

_ABSENT_S = 3.0
"""Seconds unseen after which someone counts as absent: who is hidden for a moment does not flutter."""


class SiteReader:
    """The state of a site. People keep their entries when they leave, until the service ends."""

    def __init__(self, service: BestViewService) -> None:
        self._service = service
        self._named: dict[str, PublishedPerson] = {}

    @property
    def site(self) -> str:
        """The site's name."""
        return self._service.config.site.name

    @property
    def area(self) -> int | None:
        """The service's area; None: it has the whole site."""
        sharding = self._service.config.view.sharding
        return sharding.shard if sharding.areas else None

    def read(self) -> SiteState:
        """Return the state now."""
        service = self._service
        people, rules = service.people.list_people(), service.rules.rules()
        people = [person for person in people if service.people.is_reported(person.number)]
        elsewhere = self._names_elsewhere(people)
        recording = service.recordings.status
        keepers = service.config.view.sharding.keepers
        return SiteState(
            site=self.site,
            people=sum(self._is_present(person) for person in people),
            persons=self._persons(people, elsewhere),
            elsewhere={person_key(name) for name in elsewhere},
            cameras=[
                PublishedCamera(camera.camera, camera.state, camera.condition, camera.covered_share)
                for camera in service.cameras.list_cameras()
                if keepers is None or camera.camera in keepers
            ],
            zones={zone.zone: len(zone.objects) for zone in rules.zones if zone.area is not None},
            rules=[PublishedRule(rule.rule, rule.kind, rule.lasting) for rule in rules.rules],
            recording=recording.is_on if recording.enabled else None,
        )

    def switch_recording(self, *, is_on: bool) -> None:
        """Switch recording to disk on or off."""
        self._service.recordings.switch(is_on=is_on)

    async def picture_of(self, person: PublishedPerson) -> bytes | None:
        """Return a new picture of a person's best view, JPEG; None: they are absent, or it cannot be had."""
        if not person.is_present or person.number is None:
            return None
        rendering, view = self._service.rendering, PersonView(person.number)
        try:
            newest = rendering.newest(view)
            if newest is None:
                return None
            with rendering.using(view) as stream:
                return (await stream.still("plain", newest)).data
        except (KeyError, RenderPoolFullError, PictureTimeoutError):
            return None

    def _names_elsewhere(self, people: list[PersonSummary]) -> set[str]:
        """Return the names of people about whom another area tells, and nobody here."""
        names = self._service.people.manual_overrides().names
        elsewhere = {name for number, name in names.items() if not self._service.people.is_reported(number)}
        return elsewhere.difference(person.name for person in people if person.name)

    def _persons(self, people: list[PersonSummary], elsewhere: set[str]) -> list[PublishedPerson]:
        """Return all named people; of several with one name the present one, or the one seen last."""
        now: dict[str, PersonSummary] = {}
        for person in people:
            before = now.get(person.name or "")
            if person.name and (before is None or before.last_seen < person.last_seen):
                now[person.name] = person
        current_names = set(self._service.people.manual_overrides().names.values())
        for name, person in now.items():
            is_present = self._is_present(person)
            zones = tuple(self._service.rules.zones_of(person.number)) if is_present else ()
            self._named[name] = PublishedPerson(name, person.number, is_present, person.camera, zones)
        for name in list(self._named):
            if name not in now:
                if name in current_names - elsewhere:
                    self._named[name] = PublishedPerson(name)
                else:  # renamed, or forgotten
                    del self._named[name]
        return sorted(self._named.values(), key=lambda person: person.name)

    def _is_present(self, person: PersonSummary) -> bool:
        unseen = self._service.decided_end - person.last_seen
        return bool(person.cameras) or unseen <= _ABSENT_S * self._service.config.site.fps
