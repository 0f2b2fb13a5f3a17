"""The cameras remember who is who: what they are told, and what they say to a service that begins anew."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Sequence

import msgspec

from server.messaging.identity_snapshot import SNAPSHOT_BYTES_MAX, IdentitySnapshot
from server.messaging.inbox import Message
from server.messaging.messages import camera_of_key
from server.service.identity.people import PersonTracker
from server.service.identity.state_recovery import (
    LONGEST_S,
    StateRecovery,
    first_free_number,
    state_for_cameras,
    trusted_first_free,
)

log = logging.getLogger(__name__)

PATIENCE_S = 1.0
"""How long a camera that has come is waited for until it says what it remembers."""
_LATELY_S = 10.0
"""A camera whose words come late, on a machine with too much to do, goes on following all the same."""
_COMES_S = 10.0
"""How long after the beginning a camera may still come that remembers more people: its way may be slow."""
_EVERY_S = 1.0
"""Seconds between two words of the same to a camera: each says when it was true."""


class StateReplication:
    """Starts from the state that cameras retain, and sends them the state to retain.

    Args:
        people: who is who.
        cameras: all of them.
        fps: frames a second.
        send: sends a camera its word.
        tells: whether this service does so; of several one is enough, since they agree.
        clock: seconds that only go forward.
    """

    def __init__(
        self,
        people: PersonTracker,
        cameras: Sequence[str],
        fps: float,
        send: Callable[[str, bytes], None],
        *,
        tells: bool = True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._people, self._cameras, self._fps = people, cameras, fps
        self._send, self._tells, self._clock = send, tells, clock
        self._came: dict[str, float] = {}
        """When each camera came first that has not said yet what it remembers; it may come again."""
        self._there: set[str] = set()
        self._said: dict[str, IdentitySnapshot] = {}
        self._firsts: dict[str, int] = {}
        """The first free number by what each camera said last."""
        self._returning: list[StateRecovery] = []
        """First of all who had come when this began, then a camera each that came later."""
        self._anybody = False
        self._began_at: float | None = None
        self._free = math.inf
        """From this number on this run gives them anew, by what it began with; before that it gives none."""
        self._heard: set[str] = set()
        """Cameras that have said what they remember: told sooner, they would have forgotten it."""
        self._sent: dict[str, IdentitySnapshot] = {}
        self._since = time.time()

    def alive(self, key: str, there: bool) -> None:
        """A camera's liveliness token came or went."""
        camera = camera_of_key(key)
        if camera in self._cameras and there:
            self._anybody = True
            self._there.add(camera)
            if camera not in self._heard:  # its token may come after its word
                self._came.setdefault(camera, self._clock())
        else:
            self._there.discard(camera)

    def heard(self, message: Message) -> None:
        """A camera says what it remembers.

        One that reached the service only after the beginning is heard, too; of what a camera says again only
        the numbers that are taken are of use.

        Raises:
            DecodeError or another of `UNREADABLE`: it is none.
        """
        camera = camera_of_key(message.key)
        if camera not in self._cameras:
            return
        again = self._began_at is not None and camera in self._heard
        self._came.pop(camera, None)
        self._heard.add(camera)
        if not message.payload:
            return
        said = msgspec.json.decode(message.payload, type=IdentitySnapshot)
        self._firsts[camera] = first_free_number(said)
        if again:
            self._people.begin_at(min(said.next_number, trusted_first_free(self._firsts.values())))
        else:
            self._said[camera] = said

    @property
    def waits(self) -> bool:
        """Whether a camera may still say what it remembers, so that nothing should be decided yet."""
        if self._began_at is not None:
            return False
        now = self._clock()
        return any(now < came + PATIENCE_S for camera, came in self._came.items() if camera in self._there)

    def awaits(self, number: int) -> bool:
        """Return whether a person of this number may be re-identified, or is so in a decision to come."""
        if self._began_at is None or self._people.roll.whose(number) in self._people.roll.first_seen:
            return True
        comes = self._heard < set(self._cameras) and self._clock() < self._began_at + _COMES_S
        return (comes and number < self._free) or any(number in it.numbers for it in self._returning)

    @property
    def numbers_since(self) -> float:
        """When numbers began, unix seconds: since then none was given twice. 0: nobody has one yet."""
        return self._since if self._began_at is not None or self._people.roll.first_seen else 0.0

    def begin(self, pulse: int) -> None:
        """Begin with what is remembered, before an epoch that ends with a pulse is taken in.

        As long as no camera has come there is nothing to begin with. What is said later adds to it.
        """
        if not self._anybody or (self._began_at is not None and not self._said):
            return
        most = trusted_first_free(self._firsts.values())
        for camera in [camera for camera, it in self._said.items() if first_free_number(it) > most]:
            log.warning("camera %s alone remembers numbers beyond %d: it is not believed", camera, most)
            del self._said[camera]
        said = {camera: _below(self._free, it) for camera, it in self._said.items()}
        self._said = {}
        returning = StateRecovery(said, pulse, round(LONGEST_S * self._fps))
        returning.begin(self._people, pulse)
        self._returning.append(returning)
        if self._began_at is None:
            self._began_at, self._free = self._clock(), self._people.next_number
            self._since = min(self._since, returning.numbered_since)
        if said:
            log.info("%s: remembered %d people", ", ".join(sorted(said)), len(returning.numbers))

    def take(self, pulse: int) -> None:
        """Look at people after an epoch that ends with a pulse was taken in."""
        for returning in self._returning:
            returning.look(self._people, pulse)
        self._returning = [it for it in self._returning if not it.over]
        if self._began_at is not None and self._tells:
            self._tell(pulse)

    def _tell(self, pulse: int) -> None:
        lately = round(_LATELY_S * self._fps)
        for camera, now in state_for_cameras(self._people, self._cameras, pulse, lately, self._since).items():
            if camera not in self._heard:
                continue
            before = self._sent.get(camera)
            if before is not None and pulse - before.pulse < _EVERY_S * self._fps and _same(before, now):
                continue
            payload = msgspec.json.encode(now)
            if len(payload) <= SNAPSHOT_BYTES_MAX:
                self._sent[camera] = now
                self._send(camera, payload)


def _below(free: float, said: IdentitySnapshot) -> IdentitySnapshot:
    """Leave out whom this run does not know by the number, since it may have given it to somebody else."""
    known = [it for it in said.people if max([it.number, *it.aliases]) < free]
    return msgspec.structs.replace(said, people=known)


def _same(one: IdentitySnapshot, other: IdentitySnapshot) -> bool:
    return msgspec.structs.replace(one, pulse=other.pulse) == other
