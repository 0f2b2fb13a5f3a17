"""The record of who is who, which the best-view services of a site exchange.

Every service computes identities by itself, the same from the same messages. Once a second, with areas every
epoch, it publishes its record; the others compare it with their own of the same pulse, and follow the leading
service where they differ. A service that starts takes over the state of the leading one: the record, and what
is known about people besides their tracks.
"""

from __future__ import annotations

from typing import Annotated

import msgspec

from server.messaging.camera_identity_snapshot import (
    ALIASES_MAX,
    NAME_LENGTH_MAX,
    PERSON_NUMBER_MAX,
    CameraIdentitySnapshot,
    PersonNumber,
    UnixTime,
)
from server.messaging.number_types import Number, Pulse
from server.messaging.packed_arrays import HISTOGRAM_BINS_MAX

SERVICES_MAX = 64
"""Best-view services of a site, at most."""
RECORD_BYTES_MAX = 1 << 24
"""Size limit of a record, and of a state, in bytes."""
DELETIONS_MAX = 64
"""Deletions in a record, at most."""
_NUMBERS_MAX = 1000
_CAMERAS_MAX = 1024
_PEOPLE_MAX = 100_000

NextNumber = Annotated[int, msgspec.Meta(ge=1, le=PERSON_NUMBER_MAX + 1)]
Sum = Annotated[float, msgspec.Meta(ge=0, le=1e12)]


class DeletedPerson(msgspec.Struct, frozen=True, kw_only=True):
    """A person whose data an operator has deleted."""

    numbers: Annotated[list[PersonNumber], msgspec.Meta(min_length=1, max_length=_NUMBERS_MAX)]
    """All of their numbers, rising."""
    numbers_since: UnixTime
    """When these numbers began."""
    deletes_media: bool
    """Whether the recorded video and sound of the times in which they were visible are deleted, too."""


class AreaStay(msgspec.Struct, frozen=True, array_like=True):
    """How long a person has been in an area."""

    first_seen: Pulse
    """By any service."""
    here: Pulse
    """When they were certainly in the area, the last time."""


class ServiceRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The people that a service tracks at a pulse."""

    service: Annotated[int, msgspec.Meta(ge=0, lt=SERVICES_MAX)]
    """Its index."""
    pulse: Pulse
    unbroken_since: Pulse
    """Since then the service has decided every epoch, and was not cut off from all cameras. The one with the
    lowest leads; of equal ones, that with the lowest index. One that was stopped follows the others."""
    cameras: Annotated[dict[str, CameraIdentitySnapshot], msgspec.Meta(max_length=_CAMERAS_MAX)]
    """What each camera tracks."""
    in_area: Annotated[dict[PersonNumber, AreaStay], msgspec.Meta(max_length=_PEOPLE_MAX)] = {}
    """The people in the area of the service, by number; empty: there are no areas."""
    next_numbers: Annotated[list[NextNumber], msgspec.Meta(max_length=SERVICES_MAX)] = []
    """By area, the first number that its services have not assigned, as far as is known."""
    deletions: Annotated[list[DeletedPerson], msgspec.Meta(max_length=DELETIONS_MAX)] = []
    """The newest deletions, its own and others', in order: every service carries them out."""

    @property
    def rank(self) -> tuple[int, int]:
        """The service with the lowest leads."""
        return self.unbroken_since, self.service

    @property
    def numbered_since(self) -> float:
        """When its numbers began, unix seconds; 0: it has none."""
        return max((snapshot.numbered_since for snapshot in self.cameras.values()), default=0.0)

    @property
    def next_number(self) -> int:
        """The first number that it has not assigned."""
        return max((snapshot.next_number for snapshot in self.cameras.values()), default=1)


class CameraHistogram(msgspec.Struct, frozen=True, kw_only=True):
    """A person's color histograms in one camera."""

    frames: Annotated[int, msgspec.Meta(ge=1, le=2**40)]
    sums: Annotated[list[Sum], msgspec.Meta(min_length=1, max_length=HISTOGRAM_BINS_MAX)]
    """Sum of the frames' histograms."""


class PersonState(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What is known about a person besides the tracks that a record has."""

    number: PersonNumber
    first_seen: Pulse
    last_seen: Pulse
    departed: bool = False
    camera: str = ""
    """Of the last sighting."""
    settled_frames: Number = 0
    """Frames behind the histograms that were published with this number."""
    aliases: Annotated[list[PersonNumber], msgspec.Meta(max_length=ALIASES_MAX)] = []
    name: Annotated[str, msgspec.Meta(max_length=NAME_LENGTH_MAX)] = ""
    histograms: Annotated[dict[str, CameraHistogram], msgspec.Meta(max_length=_CAMERAS_MAX)] = msgspec.field(
        name="looks", default_factory=dict
    )
    """By camera."""


class ServiceState(msgspec.Struct, frozen=True, kw_only=True):
    """What a service that starts takes over from the leading one."""

    record: ServiceRecord
    people: Annotated[list[PersonState], msgspec.Meta(max_length=_PEOPLE_MAX)]
