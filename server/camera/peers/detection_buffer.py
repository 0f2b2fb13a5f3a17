"""What the other cameras said they found, by pulse, and who is still waited for. It is told the time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from server.camera.peers.cross_view_scorer import PeerDetections
from server.messaging.messages import FrameDetections

_ASKED = 256
"""Pulses for which it is remembered until when their words counted."""


@dataclass(slots=True)
class _Other:
    """One other camera."""

    boot: int | None = None
    newest: int = -1
    """The last pulse that it spoke of."""
    ended: bool = False
    trusted: bool = True
    """False after it was late: it is not waited for until it would have been in time again."""
    near: bool | None = None
    """Whether it looks at ground that this camera sees; None: that is not known yet."""
    words: dict[int, FrameDetections] = field(default_factory=dict)


class PeerDetectionBuffer:
    """Collects the detections of other cameras. A camera that is late is not waited for until it is in time.

    A camera's words come in the order of their pulses, so whoever has spoken of a later one has nothing
    more to say. Who has never been there, is gone or is too slow costs one wait.

    Args:
        others: the cameras that may say something.
        most: words of one camera that are kept; more of them would be of frames far ahead.
        looks_here: tells by a camera's first word whether it sees the same ground.
    """

    def __init__(
        self, others: Sequence[str], most: int, looks_here: Callable[[FrameDetections], bool]
    ) -> None:
        self._others = {camera: _Other() for camera in others}
        self._most, self._looks_here = most, looks_here
        self._asked: deque[tuple[int, float]] = deque(maxlen=_ASKED)

    def put(self, word: FrameDetections, now: float) -> bool:
        """Take a word; give whether its camera sees the same ground: if not, no more of it is needed."""
        other = self._others[word.camera]
        if other.boot != word.boot:
            # The near and far stay as they are: where a camera stands is in the configuration.
            other.boot, other.newest, other.ended, other.trusted = word.boot, -1, False, True
            other.words.clear()
        if other.near is None:
            other.near = self._looks_here(word)
        until = next((until for pulse, until in reversed(self._asked) if pulse == word.pulse), None)
        current = self._asked[-1][0] if self._asked else -1
        other.trusted |= word.pulse > current or (until is not None and now <= until)
        other.newest = max(other.newest, word.pulse)
        other.ended |= word.ended
        if other.near and not word.ended and word.pulse >= current and len(other.words) < self._most:
            other.words[word.pulse] = word
        return other.near

    def ask(self, pulse: int, until: float) -> None:
        """Ask for the words about a frame, which count until then; those about earlier ones are forgotten.

        Pulses must grow.
        """
        self._asked.append((pulse, until))
        for other in self._others.values():
            for old in [it for it in other.words if it < pulse]:
                del other.words[old]

    def misses(self, pulse: int) -> bool:
        """Return whether somebody's word on this frame is worth waiting for."""
        return any(_missed(other, pulse) for other in self._others.values())

    def give_up(self, pulse: int) -> list[str]:
        """Wait no more; give who was waited for."""
        late = [camera for camera, other in self._others.items() if _missed(other, pulse)]
        for camera in late:
            self._others[camera].trusted = False
        return late

    def heard(self, pulse: int) -> PeerDetections:
        """Return what was said of a frame, in the order of the configuration."""
        words = [other.words[pulse] for other in self._others.values() if pulse in other.words]
        alone = any(_expected(other, pulse) and pulse not in other.words for other in self._others.values())
        return PeerDetections(tuple(words), alone)


def _expected(other: _Other, pulse: int) -> bool:
    """Return whether a camera has something to say of a frame."""
    return other.near is not False and not (other.ended and pulse >= other.newest)


def _missed(other: _Other, pulse: int) -> bool:
    return _expected(other, pulse) and other.trusted and pulse not in other.words and other.newest < pulse
