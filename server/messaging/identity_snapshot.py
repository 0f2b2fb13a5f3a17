"""Snapshot of people's identities, which cameras keep for a best-view service that restarts.

A number means nothing to the next run of the service. But the cameras' processes outlast it, and go on
following: whoever one of their tracks follows before and after is the same person, as far as a track is ever
somebody. So each camera is told whose its tracks are, keeps the newest word, unread, and says it to every
service that comes.
"""

from __future__ import annotations

from typing import Annotated

import msgspec

from server.messaging.number_types import Number, Pulse

PERSON_NUMBER_MAX = 999_999_999
"""As many digits as an address may have."""
SNAPSHOT_BYTES_MAX = 1 << 20
"""Bytes that a camera keeps at most."""
ALIASES_MAX = 64
"""Old numbers of one person that are told; the newest."""
NAME_LENGTH_MAX = 40
"""Letters of a name."""

UnixTime = Annotated[float, msgspec.Meta(ge=0, le=1e12)]
"""Seconds."""
PersonNumber = Annotated[int, msgspec.Meta(ge=1, le=PERSON_NUMBER_MAX)]


class PersonSnapshot(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One person whom the camera tracks."""

    number: PersonNumber
    tracks: list[Number]
    """Those that follow them, by the camera's own numbers."""
    aliases: Annotated[list[PersonNumber], msgspec.Meta(max_length=ALIASES_MAX)] = []
    """Numbers that turned out to be theirs."""
    name: Annotated[str, msgspec.Meta(max_length=NAME_LENGTH_MAX)] = ""
    manual: bool = False
    """Somebody said that several numbers are theirs."""


class IdentitySnapshot(msgspec.Struct, frozen=True, kw_only=True):
    """The people whom one camera tracks, as of a pulse."""

    pulse: Pulse
    boot: Number
    """The run of the camera whose tracks are named."""
    next_number: Annotated[int, msgspec.Meta(ge=1, le=PERSON_NUMBER_MAX + 1)]
    """The first number that nobody was given yet in the whole site."""
    numbered_since: UnixTime
    """When numbers began: since then none was given twice."""
    people: list[PersonSnapshot]
