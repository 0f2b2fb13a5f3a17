"""The peers' detections by pulse, and which peers to wait for. Has no clock: the caller passes the time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from server.camera.peers.cross_view_scorer import PeerDetections
from server.messaging.messages import FrameDetections

_DEADLINES_MAX = 256
"""Pulses whose deadline is remembered."""


@dataclass(slots=True)
class _Peer:
    """State of one peer camera."""

    boot: int | None = None
    newest: int = -1
    """The pulse of its newest message."""
    ended: bool = False
    trusted: bool = True
    """False after a late message: it is not waited for until a message arrives in time."""
    overlaps: bool | None = None
    """Whether it sees the same ground as this camera; None: not known yet."""
    messages: dict[int, FrameDetections] = field(default_factory=dict)


class PeerDetectionBuffer:
    """Collects the detections of peer cameras. A camera that is late is not waited for until it is in time.

    A camera's messages come in pulse order: after a later one, an earlier one cannot follow. A camera that
    never connected, has left or is too slow costs one wait.

    Args:
        others: the peer cameras.
        most: messages to keep of one camera; more would be of frames far ahead.
        sees_same_ground: returns for a camera's first message whether it sees the same ground.
    """

    def __init__(
        self, others: Sequence[str], most: int, sees_same_ground: Callable[[FrameDetections], bool]
    ) -> None:
        self._peers = {camera: _Peer() for camera in others}
        self._most, self._sees_same_ground = most, sees_same_ground
        self._deadlines: deque[tuple[int, float]] = deque(maxlen=_DEADLINES_MAX)

    def put(self, message: FrameDetections, now: float) -> bool:
        """Add a message; return whether its camera sees the same ground and is worth listening to."""
        peer = self._peers[message.camera]
        if peer.boot != message.boot:
            # `overlaps` stays: where a camera stands is in the configuration.
            peer.boot, peer.newest, peer.ended, peer.trusted = message.boot, -1, False, True
            peer.messages.clear()
        if peer.overlaps is None:
            peer.overlaps = self._sees_same_ground(message)
        until = next((until for pulse, until in reversed(self._deadlines) if pulse == message.pulse), None)
        current = self._deadlines[-1][0] if self._deadlines else -1
        peer.trusted |= message.pulse > current or (until is not None and now <= until)
        peer.newest = max(peer.newest, message.pulse)
        peer.ended |= message.ended
        if (
            peer.overlaps
            and not message.ended
            and message.pulse >= current
            and len(peer.messages) < self._most
        ):
            peer.messages[message.pulse] = message
        return peer.overlaps

    def expect(self, pulse: int, until: float) -> None:
        """Set the deadline for messages about a frame, and forget those about earlier ones.

        Pulses must ascend.
        """
        self._deadlines.append((pulse, until))
        for peer in self._peers.values():
            for old in [it for it in peer.messages if it < pulse]:
                del peer.messages[old]

    def is_missing(self, pulse: int) -> bool:
        """Return whether a message about this frame is still worth waiting for."""
        return any(_missed(peer, pulse) for peer in self._peers.values())

    def give_up(self, pulse: int) -> list[str]:
        """Stop waiting; return the cameras whose message is missing."""
        late = [camera for camera, peer in self._peers.items() if _missed(peer, pulse)]
        for camera in late:
            self._peers[camera].trusted = False
        return late

    def detections_at(self, pulse: int) -> PeerDetections:
        """Return the detections of a frame, in the order of the configuration."""
        messages = [peer.messages[pulse] for peer in self._peers.values() if pulse in peer.messages]
        is_incomplete = any(
            _expected(peer, pulse) and pulse not in peer.messages for peer in self._peers.values()
        )
        return PeerDetections(tuple(messages), is_incomplete)


def _expected(peer: _Peer, pulse: int) -> bool:
    """Return whether a camera should have detections for a frame."""
    return peer.overlaps is not False and not (peer.ended and pulse >= peer.newest)


def _missed(peer: _Peer, pulse: int) -> bool:
    return _expected(peer, pulse) and peer.trusted and pulse not in peer.messages and peer.newest < pulse
