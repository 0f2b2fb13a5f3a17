"""What a camera keeps for the best-view service, which may be started anew: who its tracks are."""

from __future__ import annotations

from collections.abc import Callable

from server.messaging.identity_snapshot import SNAPSHOT_BYTES_MAX
from server.messaging.inbox import Message


class RetainedState:
    """Keeps the newest state of the service, unread, and sends it to every service that starts.

    ``send`` sends it.
    """

    def __init__(self, send: Callable[[bytes], None]) -> None:
        self._send = send
        self._kept = b""

    def put(self, message: Message) -> None:
        """Take a word in the place of the one before; one that is too long is not kept."""
        if len(message.payload) <= SNAPSHOT_BYTES_MAX:
            self._kept = message.payload

    def service(self, there: bool) -> None:
        """Send the retained state to a service that appeared; an empty one too, so that it need not wait."""
        if there:
            self._send(self._kept)
