"""Lining the cameras up: an epoch is decided when every camera that can has spoken, or time is up."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, field

from server.messaging.epochs import end_of_epoch
from server.messaging.messages import CameraTracks

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
    skipped: int = 0
    """Epochs before it that are left out: nobody spoke of them, and they are long past."""


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


class EpochAligner:
    """Collects the cameras' messages by epoch. Has no clock: the caller passes the pulse number.

    ``grace`` is how many pulses a camera that is there is waited for, after an epoch's end and the first
    word on it. While none has, they are all ``behind``: the first is waited for so many pulses more.
    Without any of them it could only go on with nobody.

    What is more than ``far`` pulses away from the present is of another time: epochs begin with what is not,
    and where nobody has a word on one that is so long past, they go on with what is not. None: there is no
    present, as of recordings, and nothing is left out.
    """

    def __init__(
        self, cameras: Sequence[str], stride: int, grace: int, behind: int = 0, far: int | None = None
    ) -> None:
        self.stride, self._grace, self._behind, self._far = stride, grace, behind, far
        self._places = {camera: _Place() for camera in cameras}
        self._next: int | None = None
        self._shown: dict[str, int] = {}
        """By camera: the first epoch of which a frame has come, while it is not known where to begin."""
        self._heard: int | None = None
        """The pulse at which somebody had spoken of the next epoch, or of a later one."""
        self._left_out = 0
        """Epochs that are, before the next one."""
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
            epoch = pulse // self.stride
            self._shown[camera] = min(epoch, self._shown.get(camera, epoch))

    def tracks(self, message: CameraTracks) -> None:
        """A camera's window came."""
        if self._next is not None and message.epoch < self._next:
            self._too_late(message)
            return
        place = self._places[message.camera]
        place.waiting[message.epoch] = message
        place.trusted = True

    def behind(self, now: int) -> int:
        """Return pulses between the end of the next epoch that somebody has spoken of and pulse ``now``."""
        first = min(self._words(), default=None)
        return 0 if first is None else max(0, now - end_of_epoch(first, self.stride))

    def leave_out(self, now: int) -> int:
        """Go on with the newest epoch up to pulse ``now`` that anybody has spoken of.

        Returns:
            How many are left out for that.
        """
        to = max((it for it in self._words() if end_of_epoch(it, self.stride) <= now), default=0)
        if self._next is None or to <= self._next:
            return 0
        return self._leap(self._next, to)

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
        if self._next is None:
            self._begin(now)
        if self._next is None or self.all_ended:
            return None
        number = self._next = self._caught_up(now, self._next)
        end = end_of_epoch(number, self.stride)
        missing = [name for name, place in self._places.items() if self._awaited(place, end)]
        any_word = any(place.waiting for place in self._places.values())
        if any_word and self._heard is None:
            self._heard = now
        if (missing or not any_word) and now <= self._patience(end):
            return None
        if self._far is not None and 0 <= now < end - self._grace:
            return None  # who speaks of what is to come does not take the others' word from them
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
        skipped, self._left_out = self._left_out, 0
        return Epoch(number, end, taken, (*late, *self._skipped(end, taken)), mended, skipped)

    def _begin(self, now: int) -> None:
        """Begin with the first epoch that anybody has spoken of, but for words of another time."""
        self._drop(lambda epoch: not self._is_near(epoch, now))
        words = [*self._words(), *(it for it in self._shown.values() if self._is_near(it, now))]
        self._next = min(words, default=None)
        self._shown.clear()

    def _caught_up(self, now: int, number: int) -> int:
        """Return the epoch to go on with: where ``number`` is long past, one of the present."""
        if end_of_epoch(number, self.stride) > now or self._is_near(number, now) or number in self._words():
            return number
        to = min((it for it in self._words() if self._is_near(it, now)), default=now // self.stride)
        self._leap(number, to)
        return to

    def _leap(self, number: int, to: int) -> int:
        self._drop(lambda epoch: epoch < to)
        self._left_out, self._heard, self._next = self._left_out + to - number, None, to
        return to - number

    def _words(self) -> list[int]:
        """List the epochs of all words that wait."""
        return [epoch for place in self._places.values() for epoch in place.waiting]

    def _is_near(self, epoch: int, now: int) -> bool:
        """Return whether an epoch is of about now; all are while nobody knows what is now."""
        return self._far is None or now < 0 or abs(end_of_epoch(epoch, self.stride) - now) <= self._far

    def _drop(self, which: Callable[[int], bool]) -> None:
        """Drop the words on some epochs, as those that come too late."""
        for place in self._places.values():
            for epoch in [epoch for epoch in place.waiting if which(epoch)]:
                self._too_late(place.waiting.pop(epoch))

    def _too_late(self, message: CameraTracks) -> None:
        self.late_messages[message.camera] += 1
        if message.revised_from is not None:
            self._mended.append(message)  # that the past was mended is not said again
        # It ended while nobody waited for it: that must not be lost, or its end is waited for.
        self._places[message.camera].ended |= message.ended

    def _patience(self, end: int) -> int:
        """Return the last pulse at which an epoch with this end is waited for."""
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
        """Return whether this camera's word on the epoch is still to come."""
        if place.waiting or place.ended or not place.there or not place.trusted:
            return False  # a word on a later epoch: on this one there will be none
        return place.first is None or place.first <= end
