"""Buffers the peers' detections by pulse, and decides which peers to wait for. The caller passes the time."""

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
    """False after a late message, until one arrives in time: it is not waited for."""
    overlaps: bool | None = None
    """Whether it sees the same ground as this camera; None: unknown yet."""
    messages: dict[int, FrameDetections] = field(default_factory=dict)


class PeerDetectionBuffer:
    """Collects the detections of peer cameras. It does not wait for one that was late last time.

    A camera's messages arrive in pulse order. A camera that never connected, has left or is too slow costs
    one wait.

    Args:
        peers: the peer cameras.
        messages_max: messages to keep per camera; more would be about frames far ahead.
        view_overlaps: returns whether the sender of a message sees ground that this camera sees.
    """

    def __init__(
        self, peers: Sequence[str], messages_max: int, view_overlaps: Callable[[FrameDetections], bool]
    ) -> None:
        self._peers = {camera: _Peer() for camera in peers}
        self._messages_max, self._view_overlaps = messages_max, view_overlaps
        self._deadlines: deque[tuple[int, float]] = deque(maxlen=_DEADLINES_MAX)

    def put(self, message: FrameDetections, now: float) -> bool:
        """Add a message; return whether its camera sees the same ground, so that its messages are useful."""
        peer = self._peers[message.camera]
        if peer.boot != message.boot:
            # `overlaps` stays: it follows from the configuration.
            peer.boot, peer.newest, peer.ended, peer.trusted = message.boot, -1, False, True
            peer.messages.clear()
        if peer.overlaps is None:
            peer.overlaps = self._view_overlaps(message)
        deadline = next((limit for pulse, limit in reversed(self._deadlines) if pulse == message.pulse), None)
        current = self._deadlines[-1][0] if self._deadlines else -1
        peer.trusted |= message.pulse > current or (deadline is not None and now <= deadline)
        peer.newest = max(peer.newest, message.pulse)
        peer.ended |= message.ended
        if (
            peer.overlaps
            and not message.ended
            and message.pulse >= current
            and len(peer.messages) < self._messages_max
        ):
            peer.messages[message.pulse] = message
        return peer.overlaps

    def expect(self, pulse: int, deadline: float) -> None:
        """Set the deadline for messages about a frame, and drop the messages about earlier ones.

        Pulses must ascend.
        """
        self._deadlines.append((pulse, deadline))
        for peer in self._peers.values():
            for old in [buffered for buffered in peer.messages if buffered < pulse]:
                del peer.messages[old]

    def must_wait(self, pulse: int) -> bool:
        """Return whether a message about this frame may arrive in time: peers that were late do not count."""
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
