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
    MAX_DOWNTIME_S,
    StateRecovery,
    first_free_number,
    state_for_cameras,
    trusted_first_free,
)

log = logging.getLogger(__name__)

PATIENCE_S = 1.0
"""How long a camera that has come is waited for until it says what it remembers."""
_RECENT_S = 10.0
"""A camera whose words come late, on a machine with too much to do, goes on following all the same."""
_JOIN_S = 10.0
"""How long after the beginning a camera may still come that remembers more people: its way may be slow."""
_INTERVAL_S = 1.0
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
        sends: bool = True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._people, self._cameras, self._fps = people, cameras, fps
        self._send, self._sends, self._clock = send, sends, clock
        self._came_at: dict[str, float] = {}
        """When each camera came first that has not said yet what it remembers; it may come again."""
        self._present: set[str] = set()
        self._snapshots: dict[str, IdentitySnapshot] = {}
        self._first_free: dict[str, int] = {}
        """The first free number by what each camera said last."""
        self._recoveries: list[StateRecovery] = []
        """First of all who had come when this began, then a camera each that came later."""
        self._any_camera = False
        self._began_at: float | None = None
        self._free = math.inf
        """From this number on this run gives them anew, by what it began with; before that it gives none."""
        self._reported: set[str] = set()
        """Cameras that have said what they remember: told sooner, they would have forgotten it."""
        self._sent: dict[str, IdentitySnapshot] = {}
        self._since = time.time()

    def alive(self, key: str, is_present: bool) -> None:
        """A camera's liveliness token came or went."""
        camera = camera_of_key(key)
        if camera in self._cameras and is_present:
            self._any_camera = True
            self._present.add(camera)
            if camera not in self._reported:  # its token may come after its word
                self._came_at.setdefault(camera, self._clock())
        else:
            self._present.discard(camera)

    def snapshot_received(self, message: Message) -> None:
        """A camera says what it remembers.

        One that reached the service only after the beginning is heard, too; of what a camera says again only
        the numbers that are taken are of use.

        Raises:
            DecodeError or another of `UNREADABLE`: it is none.
        """
        camera = camera_of_key(message.key)
        if camera not in self._cameras:
            return
        again = self._began_at is not None and camera in self._reported
        self._came_at.pop(camera, None)
        self._reported.add(camera)
        if not message.payload:
            return
        snapshot = msgspec.json.decode(message.payload, type=IdentitySnapshot)
        self._first_free[camera] = first_free_number(snapshot)
        if again:
            self._people.begin_at(min(snapshot.next_number, trusted_first_free(self._first_free.values())))
        else:
            self._snapshots[camera] = snapshot

    @property
    def is_waiting(self) -> bool:
        """Whether a camera may still say what it remembers, so that nothing should be decided yet."""
        if self._began_at is not None:
            return False
        now = self._clock()
        return any(
            now < came + PATIENCE_S for camera, came in self._came_at.items() if camera in self._present
        )

    def may_recover(self, number: int) -> bool:
        """Return whether a person of this number may be re-identified, or is so in a decision to come."""
        if (
            self._began_at is None
            or self._people.registry.current(number) in self._people.registry.first_seen
        ):
            return True
        comes = self._reported < set(self._cameras) and self._clock() < self._began_at + _JOIN_S
        return (comes and number < self._free) or any(number in it.numbers for it in self._recoveries)

    @property
    def numbers_since(self) -> float:
        """When numbers began, unix seconds: since then none was given twice. 0: nobody has one yet."""
        return self._since if self._began_at is not None or self._people.registry.first_seen else 0.0

    def begin(self, pulse: int) -> None:
        """Begin with what is remembered, before an epoch that ends with a pulse is taken in.

        As long as no camera has come there is nothing to begin with. What is said later adds to it.
        """
        if not self._any_camera or (self._began_at is not None and not self._snapshots):
            return
        most = trusted_first_free(self._first_free.values())
        for camera in [camera for camera, it in self._snapshots.items() if first_free_number(it) > most]:
            log.warning("camera %s alone remembers numbers beyond %d: it is not believed", camera, most)
            del self._snapshots[camera]
        snapshot = {camera: _below(self._free, it) for camera, it in self._snapshots.items()}
        self._snapshots = {}
        recovery = StateRecovery(snapshot, pulse, round(MAX_DOWNTIME_S * self._fps))
        recovery.begin(self._people, pulse)
        self._recoveries.append(recovery)
        if self._began_at is None:
            self._began_at, self._free = self._clock(), self._people.next_number
            self._since = min(self._since, recovery.numbered_since)
        if snapshot:
            log.info("%s: remembered %d people", ", ".join(sorted(snapshot)), len(recovery.numbers))

    def take(self, pulse: int) -> None:
        """Look at people after an epoch that ends with a pulse was taken in."""
        for recovery in self._recoveries:
            recovery.look(self._people, pulse)
        self._recoveries = [it for it in self._recoveries if not it.over]
        if self._began_at is not None and self._sends:
            self._send_state(pulse)

    def _send_state(self, pulse: int) -> None:
        recent = round(_RECENT_S * self._fps)
        for camera, now in state_for_cameras(self._people, self._cameras, pulse, recent, self._since).items():
            if camera not in self._reported:
                continue
            before = self._sent.get(camera)
            if before is not None and pulse - before.pulse < _INTERVAL_S * self._fps and _same(before, now):
                continue
            payload = msgspec.json.encode(now)
            if len(payload) <= SNAPSHOT_BYTES_MAX:
                self._sent[camera] = now
                self._send(camera, payload)


def _below(free: float, snapshot: IdentitySnapshot) -> IdentitySnapshot:
    """Leave out whom this run does not know by the number, since it may have given it to somebody else."""
    known = [it for it in snapshot.people if max([it.number, *it.aliases]) < free]
    return msgspec.structs.replace(snapshot, people=known)


def _same(one: IdentitySnapshot, other: IdentitySnapshot) -> bool:
    return msgspec.structs.replace(one, pulse=other.pulse) == other
