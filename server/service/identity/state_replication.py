"""Replication of identity state to the cameras, which return it to a restarted service."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

import msgspec

from bestview import IdSeries
from server.messaging.camera_identity_snapshot import SNAPSHOT_BYTES_MAX, CameraIdentitySnapshot
from server.messaging.inbox import Message
from server.messaging.messages import camera_of_key
from server.service.identity.person_tracker import PersonTracker
from server.service.identity.state_recovery import (
    MAX_DOWNTIME_S,
    RECENT_S,
    StateRecovery,
    first_free_number,
    state_for_cameras,
    trusted_first_free,
)

log = logging.getLogger(__name__)

SNAPSHOT_WAIT_S = 1.0
"""Seconds to wait for the snapshot of a camera that has connected."""
_JOIN_S = 10.0
"""How long after the start a camera may still connect with more people in its snapshot."""
_INTERVAL_S = 1.0
"""Seconds between two equal snapshots to a camera: each carries its pulse."""


class StateReplication:
    """Recovers the state that the cameras keep, and sends them the current state.

    Args:
        people: the person tracker.
        cameras: all cameras.
        fps: frames a second.
        send: sends a camera its snapshot.
        sends: returns whether this service sends snapshots; of several services one is enough.
        send_to: the cameras to which it sends them; None: all.
        deleted: returns the numbers of the people whose data an earlier run has deleted, of the numbers that
            began at a time, unix seconds.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        people: PersonTracker,
        cameras: Sequence[str],
        fps: float,
        send: Callable[[str, bytes], None],
        *,
        sends: Callable[[], bool] = lambda: True,
        send_to: Collection[str] | None = None,
        deleted: Callable[[float], Iterable[int]] = lambda _: (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._people, self._cameras, self._fps = people, cameras, fps
        self._send, self._sends, self._clock = send, sends, clock
        self._send_to = cameras if send_to is None else send_to
        self._deleted = deleted
        self.forgotten: list[int] = []
        """Numbers of people whose data were deleted, in order."""
        self._connected_at: dict[str, float] = {}
        """When each camera without a received snapshot first connected."""
        self._present: set[str] = set()
        self._snapshots: dict[str, CameraIdentitySnapshot] = {}
        self._first_free: dict[str, int] = {}
        """By camera, the first free number of its last snapshot."""
        self._recoveries: list[StateRecovery] = []
        """The first for all cameras present at the start, then one for each later camera."""
        self._any_camera = self._took_over = False
        self._started_at: float | None = None
        self._free = math.inf
        """The first number that this run assigns; infinite before the start."""
        self._reported: set[str] = set()
        """Cameras whose snapshot was received; sending earlier would overwrite theirs."""
        self._sent: dict[str, CameraIdentitySnapshot] = {}
        self._since = time.time()

    def set_present(self, key: str, is_present: bool) -> None:
        """Record whether a camera is present, by its liveliness token."""
        camera = camera_of_key(key)
        if camera in self._cameras and is_present:
            self._any_camera = True
            self._present.add(camera)
            if camera not in self._reported:  # the token may come after the snapshot
                self._connected_at.setdefault(camera, self._clock())
        else:
            self._present.discard(camera)

    def receive_snapshot(self, message: Message) -> None:
        """Add a camera's snapshot.

        One received after the start is used as well; of a second snapshot only the first free number.

        Raises:
            DecodeError or another of `DECODE_ERRORS`: it cannot be decoded.
        """
        camera = camera_of_key(message.key)
        if camera not in self._cameras:
            return
        is_repeated = self._started_at is not None and camera in self._reported
        self._connected_at.pop(camera, None)
        self._reported.add(camera)
        if not message.payload:
            return
        snapshot = msgspec.msgpack.decode(message.payload, type=CameraIdentitySnapshot)
        self._first_free[camera] = first_free_number(snapshot, self._people.ids)
        if is_repeated:
            self._people.identity.reserve_below(
                min(snapshot.next_number, trusted_first_free(self._first_free.values()))
            )
        else:
            self._snapshots[camera] = snapshot

    def take_over(self, snapshots: Mapping[str, CameraIdentitySnapshot]) -> None:
        """Use the snapshots, by camera, that another service has made for the cameras, before the start."""
        self._any_camera = self._took_over = True
        for camera, snapshot in snapshots.items():
            if camera in self._cameras:
                self._connected_at.pop(camera, None)
                self._reported.add(camera)
                self._snapshots[camera] = snapshot
                self._first_free[camera] = first_free_number(snapshot, self._people.ids)

    @property
    def is_waiting(self) -> bool:
        """Whether a snapshot is still expected, so that nothing should be decided yet."""
        if self._started_at is not None:
            return False
        now = self._clock()
        return any(
            now < connected_at + SNAPSHOT_WAIT_S
            for camera, connected_at in self._connected_at.items()
            if camera in self._present
        )

    def is_known_or_recoverable(self, number: int) -> bool:
        """Return whether a person of this number is known, or may still be recovered."""
        if (
            self._started_at is None
            or self._people.registry.current(number) in self._people.registry.first_seen
        ):
            return True
        may_connect = self._reported < set(self._cameras) and self._clock() < self._started_at + _JOIN_S
        return (may_connect and number < self._free) or any(
            number in recovery.numbers for recovery in self._recoveries
        )

    @property
    def numbers_since(self) -> float:
        """When numbering began, unix seconds: no number was assigned twice since. 0: none was assigned."""
        return self._since if self._started_at is not None or self._people.registry.first_seen else 0.0

    def begin(self, pulse: int) -> None:
        """Start recovery from the snapshots, before the epoch that ends with a pulse is processed.

        Does nothing before the first camera has connected. Later snapshots start further recoveries.
        """
        if not self._any_camera or (self._started_at is not None and not self._snapshots):
            return
        most = trusted_first_free(self._first_free.values())
        for camera in [
            camera
            for camera, snapshot in self._snapshots.items()
            if first_free_number(snapshot, self._people.ids) > most
        ]:
            log.warning("camera %s: snapshot ignored: it alone has person numbers beyond %d", camera, most)
            del self._snapshots[camera]
        snapshot = {
            camera: _below(self._free, snapshot, self._people.ids)
            for camera, snapshot in self._snapshots.items()
        }
        snapshot = self._without_forgotten(snapshot)
        if self._took_over and self._started_at is None:  # the other service may be ahead
            snapshot = {
                camera: msgspec.structs.replace(known, pulse=max(0, min(known.pulse, pulse - 1)))
                for camera, known in snapshot.items()
            }
        self._snapshots = {}
        recovery = StateRecovery(snapshot, pulse, round(MAX_DOWNTIME_S * self._fps), self._people.ids)
        recovery.begin(self._people, pulse)
        self._recoveries.append(recovery)
        if self._started_at is None:
            self._started_at, self._free = self._clock(), self._people.identity.next_id
            self._since = min(self._since, recovery.numbered_since)
        if snapshot:
            log.info(
                "%s: %d people restored from snapshots", ", ".join(sorted(snapshot)), len(recovery.numbers)
            )

    def advance(self, pulse: int) -> None:
        """Continue recovery, and send snapshots, after the epoch that ends with a pulse was processed."""
        for recovery in self._recoveries:
            recovery.advance(self._people, pulse)
        self._recoveries = [recovery for recovery in self._recoveries if not recovery.has_ended]
        if self._started_at is not None and self._sends():
            self._send_state(pulse)

    def follow_numbering(self, since: float) -> None:
        """Count the numbers from when those of the leading service began: they are the same."""
        if self._started_at is not None:
            self._since = since

    def deleted(self, since: float) -> set[int]:
        """Return the numbers of deleted people, of those that began at a time, unix seconds."""
        return {*self.forgotten, *self._deleted(since)}

    def forget(self, numbers: Iterable[int]) -> None:
        """Restore these people from no snapshot any more, and tell the cameras at once."""
        self.forgotten += [number for number in numbers if number not in self.forgotten]
        for recovery in self._recoveries:
            recovery.forget(self.forgotten)
        if self._started_at is not None and self._sends():
            self._send_state(self._people.newest)

    def _without_forgotten(
        self, snapshots: Mapping[str, CameraIdentitySnapshot]
    ) -> dict[str, CameraIdentitySnapshot]:
        """Remove deleted people: whom this run, an earlier one or a snapshot of the same numbers knows of."""
        gone: dict[float, set[int]] = {}
        for snapshot in snapshots.values():
            since = snapshot.numbered_since
            if since not in gone:
                gone[since] = self.deleted(since)
            gone[since].update(snapshot.forgotten)
        if gone:
            newest = gone[max(gone)]
            self.forgotten += sorted(newest.difference(self.forgotten))
        return {
            camera: msgspec.structs.replace(
                snapshot,
                people=[
                    person
                    for person in snapshot.people
                    if gone[snapshot.numbered_since].isdisjoint([person.number, *person.aliases])
                ],
            )
            for camera, snapshot in snapshots.items()
        }

    def _send_state(self, pulse: int) -> None:
        recent = round(RECENT_S * self._fps)
        states = state_for_cameras(self._people, self._cameras, pulse, recent, self._since, self.forgotten)
        for camera, now in states.items():
            if camera not in self._reported or camera not in self._send_to:
                continue
            before = self._sent.get(camera)
            if before is not None and pulse - before.pulse < _INTERVAL_S * self._fps and _same(before, now):
                continue
            payload = msgspec.msgpack.encode(now)
            if len(payload) <= SNAPSHOT_BYTES_MAX:
                self._sent[camera] = now
                self._send(camera, payload)


def _below(free: float, snapshot: CameraIdentitySnapshot, ids: IdSeries) -> CameraIdentitySnapshot:
    """Remove people whose number this run may have assigned to another person."""
    known = [
        person
        for person in snapshot.people
        if all(number < free or not ids.has(number) for number in (person.number, *person.aliases))
    ]
    return msgspec.structs.replace(snapshot, people=known)


def _same(one: CameraIdentitySnapshot, other: CameraIdentitySnapshot) -> bool:
    return msgspec.structs.replace(one, pulse=other.pulse) == other
