"""Aligns the cameras' windows by epoch: an epoch is complete when all expected cameras have reported."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field

from server.messaging.epochs import end_of_epoch
from server.messaging.messages import CameraTracks
from server.service.joint_tracking.joint_messages import JointTracks

_MAX_LATE_REVISIONS = 16
"""Late windows that revise the past, kept until the next epoch."""


@dataclass(frozen=True, slots=True)
class JointEpoch:
    """The people on the common ground."""

    tracks: JointTracks
    own: Mapping[str, CameraTracks]
    """The windows of the cameras that are tracked jointly, as they came: with their own tracks."""


@dataclass(frozen=True, slots=True)
class Epoch:
    """The windows of all cameras for one epoch."""

    number: int
    last: int
    """Its last pulse."""
    tracks: dict[str, CameraTracks]
    """By camera, in the order of the configuration."""
    late: tuple[str, ...] = ()
    """Cameras whose window did not arrive in time, or was lost."""
    late_revisions: tuple[CameraTracks, ...] = ()
    """Windows that arrived too late for their own epoch, but revise track identities of the past."""
    skipped: int = 0
    """Epochs before it that are skipped: no camera reported them, and they are too old."""
    joint: JointEpoch | None = None
    """Set once the cameras of the common ground have been tracked jointly."""
    trackless: frozenset[str] = frozenset()
    """Cameras whose joint tracks were late: their windows show nobody, whoever is there."""

    def is_joint(self, camera: str) -> bool:
        """Return whether a camera's window has tracks on the ground instead of its own."""
        return self.joint is not None and camera in self.joint.own


@dataclass(slots=True)
class _CameraQueue:
    """One camera's state and its waiting windows."""

    connected: bool = False
    boot: int | None = None
    first: int | None = None
    """First pulse of this boot."""
    ended: bool = False
    trusted: bool = True
    """False after a late window, until one arrives in time: it is not waited for."""
    waiting: dict[int, CameraTracks] = field(default_factory=dict)
    """By epoch."""


class EpochAligner:
    """Collects the cameras' windows by epoch. Has no clock: the caller passes the pulse number.

    Args:
        cameras: all cameras.
        stride: pulses of an epoch.
        grace: pulses to wait for a connected camera, after an epoch's end and the first window of it.
        backlog: further pulses to wait while no camera has reported: then all of them are behind.
        max_distance: pulses between an epoch and the present, at most. Windows farther away are dropped at
            the start, and epochs that no camera reports are skipped once they are that old. None: there
            is no present, as with recordings, and nothing is skipped.
    """

    def __init__(
        self,
        cameras: Sequence[str],
        stride: int,
        grace: int,
        backlog: int = 0,
        max_distance: int | None = None,
    ) -> None:
        self.stride, self._grace, self._backlog, self._max_distance = stride, grace, backlog, max_distance
        self._queues = {camera: _CameraQueue() for camera in cameras}
        self._next: int | None = None
        self._first_frames: dict[str, int] = {}
        """By camera, the first epoch that a frame arrived of; until the first epoch is known."""
        self._reported_at: int | None = None
        """The pulse at which a camera first reported the next epoch, or a later one."""
        self._skipped = 0
        """Epochs skipped before the next one."""
        self.late_messages = dict.fromkeys(cameras, 0)
        self._late_revisions: deque[CameraTracks] = deque(maxlen=_MAX_LATE_REVISIONS)

    def camera_connected(self, camera: str) -> None:
        """Record that a camera is connected: its windows are waited for."""
        self._queues[camera].connected = True

    def camera_disconnected(self, camera: str) -> None:
        """Record that a camera's process is gone; its earlier windows still count."""
        queue = self._queues[camera]
        queue.connected, queue.first, queue.boot = False, None, None

    def frame_received(self, camera: str, boot: int, pulse: int) -> None:
        """Record a camera's frame; from the first one of a boot on, windows are expected."""
        queue = self._queues[camera]
        queue.connected = True
        if queue.boot != boot:
            queue.boot, queue.first, queue.ended, queue.trusted = boot, pulse, False, True
        if self._next is None:
            epoch = pulse // self.stride
            self._first_frames[camera] = min(epoch, self._first_frames.get(camera, epoch))

    def add_tracks(self, message: CameraTracks) -> None:
        """Add a camera's window."""
        if self._next is not None and message.epoch < self._next:
            self._count_late(message)
            return
        queue = self._queues[message.camera]
        queue.waiting[message.epoch] = message
        queue.trusted = True

    def backlog(self, now: int) -> int:
        """Return the pulses between the end of the first epoch with a waiting window and pulse ``now``."""
        first = min(self._waiting_epochs(), default=None)
        return 0 if first is None else max(0, now - end_of_epoch(first, self.stride))

    def skip_to(self, now: int) -> int:
        """Skip to the newest epoch up to pulse ``now`` that has a waiting window.

        Returns:
            The number of skipped epochs.
        """
        to = max(
            (epoch for epoch in self._waiting_epochs() if end_of_epoch(epoch, self.stride) <= now), default=0
        )
        if self._next is None or to <= self._next:
            return 0
        return self._skip(self._next, to)

    @property
    def waiting_windows(self) -> int:
        """The number of windows that wait for others of their epoch."""
        return sum(len(queue.waiting) for queue in self._queues.values())

    @property
    def all_ended_and_decided(self) -> bool:
        """Whether every camera's recording has ended and was decided."""
        return all(queue.ended and not queue.waiting for queue in self._queues.values())

    def take_ready(self, now: int) -> list[Epoch]:
        """Remove and return the epochs that can be decided at pulse ``now``, in order."""
        epochs = []
        while (epoch := self.take_next_ready(now)) is not None:
            epochs.append(epoch)
        return epochs

    def take_next_ready(self, now: int) -> Epoch | None:
        """Remove and return the next epoch that can be decided at pulse ``now``; None: none can."""
        if self._next is None:
            self._begin(now)
        if self._next is None or self.all_ended_and_decided:
            return None
        number = self._next = self._skip_outdated(now, self._next)
        end = end_of_epoch(number, self.stride)
        missing = [name for name, queue in self._queues.items() if self._is_expected(queue, end)]
        any_reported = any(queue.waiting for queue in self._queues.values())
        if any_reported and self._reported_at is None:
            self._reported_at = now
        if (missing or not any_reported) and now <= self._deadline(end):
            return None
        if self._max_distance is not None and 0 <= now < end - self._grace:
            return None  # an early window does not shorten the wait for others
        for name in missing:
            self._queues[name].trusted = False
        self._next, self._reported_at = number + 1, None
        tracks = {}
        for name, queue in self._queues.items():
            message = queue.waiting.pop(number, None)
            if message is not None:
                tracks[name] = message
                queue.ended |= message.ended
        revisions, self._late_revisions = tuple(self._late_revisions), deque(maxlen=_MAX_LATE_REVISIONS)
        skipped, self._skipped = self._skipped, 0
        return Epoch(number, end, tracks, (*missing, *self._lost(end, tracks)), revisions, skipped)

    def _begin(self, now: int) -> None:
        """Begin with the first epoch that a camera has reported, unless it is too far from the present."""
        self._drop(lambda epoch: not self._is_near(epoch, now))
        epochs = [
            *self._waiting_epochs(),
            *(epoch for epoch in self._first_frames.values() if self._is_near(epoch, now)),
        ]
        self._next = min(epochs, default=None)
        self._first_frames.clear()

    def _skip_outdated(self, now: int, number: int) -> int:
        """Return the epoch to continue with: if ``number`` is too old, a present one."""
        if (
            end_of_epoch(number, self.stride) > now
            or self._is_near(number, now)
            or number in self._waiting_epochs()
        ):
            return number
        to = min(
            (epoch for epoch in self._waiting_epochs() if self._is_near(epoch, now)),
            default=now // self.stride,
        )
        self._skip(number, to)
        return to

    def _skip(self, number: int, to: int) -> int:
        self._drop(lambda epoch: epoch < to)
        self._skipped, self._reported_at, self._next = self._skipped + to - number, None, to
        return to - number

    def _waiting_epochs(self) -> list[int]:
        """Return the epochs of all waiting windows."""
        return [epoch for queue in self._queues.values() for epoch in queue.waiting]

    def _is_near(self, epoch: int, now: int) -> bool:
        """Return whether an epoch is near pulse ``now``; True while the present is unknown."""
        distance = abs(end_of_epoch(epoch, self.stride) - now)
        return self._max_distance is None or now < 0 or distance <= self._max_distance

    def _drop(self, is_dropped: Callable[[int], bool]) -> None:
        """Drop the waiting windows of some epochs, and count them as late."""
        for queue in self._queues.values():
            for epoch in [epoch for epoch in queue.waiting if is_dropped(epoch)]:
                self._count_late(queue.waiting.pop(epoch))

    def _count_late(self, message: CameraTracks) -> None:
        self.late_messages[message.camera] += 1
        if message.revised_from is not None:
            self._late_revisions.append(message)  # a camera sends a revision only once
        # The end of a recording must not be lost, or it is waited for.
        self._queues[message.camera].ended |= message.ended

    def _deadline(self, end: int) -> int:
        """Return the last pulse at which an epoch with this end is waited for."""
        if self._reported_at is not None:
            return max(end, self._reported_at) + self._grace
        any_expected = any(queue.connected and not queue.ended for queue in self._queues.values())
        return end + self._grace + (self._backlog if any_expected else 0)

    def _lost(self, end: int, tracks: Container[str]) -> list[str]:
        """Return the cameras whose window of an epoch is lost: they have reported later ones."""
        return [
            name
            for name, queue in self._queues.items()
            if name not in tracks and queue.waiting and queue.first is not None and queue.first <= end
        ]

    def _is_expected(self, queue: _CameraQueue, end: int) -> bool:
        """Return whether this camera's window of the epoch is still expected."""
        if queue.waiting or queue.ended or not queue.connected or not queue.trusted:
            return False  # waiting windows are of later epochs: windows come in order
        return queue.first is None or queue.first <= end
