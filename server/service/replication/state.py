"""The state of a best-view service that another one takes over: tracks, and what is known about people."""

from __future__ import annotations

import numpy as np

from bestview import Person
from bestview.association.appearance.histograms import MeanHistogram, PersonAppearance
from server.messaging.camera_identity_snapshot import ALIASES_MAX, PERSON_NUMBER_MAX
from server.messaging.service_record import CameraHistogram, PersonState, ServiceRecord, ServiceState
from server.service.identity.person_tracker import PersonTracker


def state_of(people: PersonTracker, record: ServiceRecord) -> ServiceState:
    """Build the state at the pulse of a record."""
    registry = people.registry
    remembered = {person.person_id: person for person in people.identity.people}
    states = []
    for number in registry.all_numbers:
        if number > PERSON_NUMBER_MAX:
            continue
        person = remembered.get(number)
        states.append(
            PersonState(
                number=number,
                first_seen=max(0, registry.first_seen[number]),
                last_seen=max(0, registry.last_seen[number]),
                departed=number in registry.departed,
                camera="" if person is None or person.elsewhere else person.camera,
                settled_frames=0 if person is None else person.settled_frames,
                aliases=[old for old in registry.aliases(number) if old <= PERSON_NUMBER_MAX][-ALIASES_MAX:],
                name=registry.names.get(number, ""),
                histograms={} if person is None else _histograms_of(person),
            )
        )
    return ServiceState(record=record, people=states)


def restore_people(people: PersonTracker, state: ServiceState) -> None:
    """Add what another service knows about people, before any of their tracks is reported here."""
    own = [person.number for person in state.people if people.ids.has(person.number)]
    people.identity.reserve_below(max(own, default=0) + 1)
    people.identity.restore(_person(person) for person in state.people if person.histograms)
    for person in state.people:
        seen = person.first_seen, person.last_seen
        people.registry.restore(person.number, *seen, departed=person.departed)
        people.registry.add_aliases(person.number, person.aliases)
        people.registry.set_name(person.number, person.name)


def _histograms_of(person: Person) -> dict[str, CameraHistogram]:
    return {
        camera: CameraHistogram(frames=histogram.frame_count, sums=histogram.histogram_sum.tolist())
        for camera, histogram in person.appearance.by_camera.items()
        if histogram.frame_count
    }


def _person(state: PersonState) -> Person:
    histograms = {
        camera: MeanHistogram(np.array(each.sums, dtype=np.float64), each.frames)
        for camera, each in state.histograms.items()
    }
    return Person(
        state.number,
        state.last_seen,
        state.camera,
        state.departed,
        PersonAppearance(histograms),
        state.settled_frames,
    )
