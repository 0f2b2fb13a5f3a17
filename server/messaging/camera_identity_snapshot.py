"""Snapshot of people's identities, which cameras keep for a restart of the best-view service.

The cameras' processes continue tracking while the service restarts, so a track before and after is the same
person. The service therefore sends each camera the person numbers of its tracks; the camera keeps the
newest snapshot, undecoded, and sends it to every service that starts.
"""

from __future__ import annotations

from typing import Annotated

import msgspec

from server.messaging.number_types import Number, Pulse

PERSON_NUMBER_MAX = 999_999_999
"""URLs have at most nine digits for it."""
SNAPSHOT_BYTES_MAX = 1 << 20
"""Size limit of a snapshot in bytes."""
ALIASES_MAX = 64
"""Former numbers of one person, at most; the newest."""
FORGOTTEN_MAX = 256
"""Numbers of deleted people in a snapshot, at most; the newest."""
NAME_LENGTH_MAX = 40
"""Characters of a name, at most."""

UnixTime = Annotated[float, msgspec.Meta(ge=0, le=1e12)]
"""Seconds."""
PersonNumber = Annotated[int, msgspec.Meta(ge=1, le=PERSON_NUMBER_MAX)]


class PersonSnapshot(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One person tracked by the camera."""

    number: PersonNumber
    tracks: list[Number]
    """The person's tracks, by the camera's own numbers."""
    aliases: Annotated[list[PersonNumber], msgspec.Meta(max_length=ALIASES_MAX)] = []
    """Numbers that were merged into this one."""
    name: Annotated[str, msgspec.Meta(max_length=NAME_LENGTH_MAX)] = ""
    manual: bool = False
    """Whether the operator has merged numbers into this one."""


class CameraIdentitySnapshot(msgspec.Struct, frozen=True, kw_only=True):
    """The people that one camera tracks at a pulse."""

    pulse: Pulse
    boot: Number
    """The boot of the camera that the tracks belong to."""
    next_number: Annotated[int, msgspec.Meta(ge=1, le=PERSON_NUMBER_MAX + 1)]
    """The first unused number of the site."""
    numbered_since: UnixTime
    """When numbering began: no number was assigned twice since."""
    people: list[PersonSnapshot]
    forgotten: Annotated[list[PersonNumber], msgspec.Meta(max_length=FORGOTTEN_MAX)] = []
    """Numbers of people whose data were deleted: they are restored from no snapshot, however old."""
