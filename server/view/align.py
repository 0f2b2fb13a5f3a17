"""Lining the cameras up: an epoch is decided when every camera that can has spoken, or time is up."""

from __future__ import annotations

from collections import deque
from collections.abc import Container, Sequence
from dataclasses import dataclass, field

from server.wire.epochs import end_of_epoch
from server.wire.messages import CameraTracks

_MENDED_MOST = 16
"""Words that have mended the past, and came too late, that are kept until the next epoch."""


@dataclass(frozen=True, slots=True)
class Epoch:
    """All that is known of one epoch."""

    number: int
    last: int
    """Its last pulse."""
    tracks: dict[str, CameraTracks]
    """By camera, in the order of the configuration."""
    late: tuple[str, ...] = ()
    """Cameras that were waited for in vain, and cameras whose word on it was lost on the way."""
    mended: tuple[CameraTracks, ...] = ()
    """Words on earlier epochs that came too late for these, and say who was who before."""


@dataclass(slots=True)
class _Place:
    """One camera's place in the line."""

    there: bool = False
    boot: int | None = None
    first: int | None = None
    """First pulse of this boot."""
    ended: bool = False
    trusted: bool = True
    """False after it was late: it is not waited for until it is in time again."""
    waiting: dict[int, CameraTracks] = field(default_factory=dict)


class Aligner:
    """Collects the cameras' messages by epoch. It has no clock: it is told which pulse it is.

    ``grace`` is how many pulses a camera that is there is waited for, after an epoch's end and the first
    word on it. While none has, they are all ``behind``: the first is waited for so many pulses more.
    Without any of them it could only go on with nobody.
    """

    def __init__(self, cameras: Sequence[str], stride: int, grace: int, behind: int = 0) -> None:
        self.stride, self._grace, self._behind = stride, grace, behind
        self._places = {camera: _Place() for camera in cameras}
        self._next: int | None = None
        self._heard: int | None = None
        """The pulse at which somebody had spoken of the next epoch, or of a later one."""
        self.late_messages = dict.fromkeys(cameras, 0)
        self._mended: deque[CameraTracks] = deque(maxlen=_MENDED_MOST)

    def come(self, camera: str) -> None:
        """A camera is there."""
        self._places[camera].there = True

    def gone(self, camera: str) -> None:
        """A camera's process is gone; what it said before still counts."""
        place = self._places[camera]
        place.there, place.first, place.boot = False, None, None

    def frame(self, camera: str, boot: int, pulse: int) -> None:
        """A camera's frame came: from its pulse on the camera takes part."""
        place = self._places[camera]
        place.there = True
        if place.boot != boot:
            place.boot, place.first, place.ended, place.trusted = boot, pulse, False, True
        if self._next is None:
            self._next = pulse // self.stride

    def tracks(self, message: CameraTracks) -> None:
        """A camera's window came."""
        place = self._places[message.camera]
        if self._next is None:
            self._next = message.epoch
        if message.epoch < self._next:
            self.late_messages[message.camera] += 1
            if message.mended_from is not None:
                self._mended.append(message)  # that the past was mended is not said again
            # It ended while nobody waited for it: that must not be lost, or its end is waited for.
            place.ended |= message.ended
            return
        place.waiting[message.epoch] = message
        place.trusted = True

    @property
    def waiting(self) -> int:
        """How many windows wait for others of their epoch."""
        return sum(len(place.waiting) for place in self._places.values())

    @property
    def all_ended(self) -> bool:
        """Whether every camera's recording is over and was taken out."""
        return all(place.ended and not place.waiting for place in self._places.values())

    def ready(self, now: int) -> list[Epoch]:
        """Take out the epochs that can be decided at pulse ``now``, in order."""
        epochs = []
        while (epoch := self.next_ready(now)) is not None:
            epochs.append(epoch)
        return epochs

    def next_ready(self, now: int) -> Epoch | None:
        """Take out the next one of them; None: there is none."""
        number = self._next
        if number is None or self.all_ended:
            return None
        end = end_of_epoch(number, self.stride)
        missing = [name for name, place in self._places.items() if self._awaited(place, end)]
        any_word = any(place.waiting for place in self._places.values())
        if any_word and self._heard is None:
            self._heard = now
        if (missing or not any_word) and now <= self._patience(end):
            return None
        late = tuple(missing)
        for name in late:
            self._places[name].trusted = False
        self._next, self._heard = number + 1, None
        taken = {}
        for name, place in self._places.items():
            message = place.waiting.pop(number, None)
            if message is not None:
                taken[name] = message
                place.ended |= message.ended
        mended, self._mended = tuple(self._mended), deque(maxlen=_MENDED_MOST)
        return Epoch(number, end, taken, (*late, *self._skipped(end, taken)), mended)

    def _patience(self, end: int) -> int:
        """Give the last pulse at which an epoch with this end is waited for."""
        if self._heard is not None:
            return max(end, self._heard) + self._grace
        expected = any(place.there and not place.ended for place in self._places.values())
        return end + self._grace + (self._behind if expected else 0)

    def _skipped(self, end: int, taken: Container[str]) -> list[str]:
        """List the cameras whose word on an epoch is lost: they were there, and have spoken of later ones."""
        return [
            name
            for name, place in self._places.items()
            if name not in taken and place.waiting and place.first is not None and place.first <= end
        ]

    def _awaited(self, place: _Place, end: int) -> bool:
        """Tell whether this camera's word on the epoch is still to come."""
        if place.waiting or place.ended or not place.there or not place.trusted:
            return False  # a word on a later epoch: on this one there will be none
        return place.first is None or place.first <= end
