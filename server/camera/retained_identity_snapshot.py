"""Identity snapshot that a camera retains for a best-view service that restarts."""

from __future__ import annotations

from collections.abc import Callable

from server.messaging.camera_identity_snapshot import SNAPSHOT_BYTES_MAX
from server.messaging.inbox import Message


class RetainedIdentitySnapshot:
    """Holds the service's newest identity snapshot, undecoded; sends it to every service that starts."""

    def __init__(self, send: Callable[[bytes], None]) -> None:
        self._send = send
        self._snapshot = b""

    def replace(self, message: Message) -> None:
        """Replace the snapshot; one that is too long is ignored."""
        if len(message.payload) <= SNAPSHOT_BYTES_MAX:
            self._snapshot = message.payload

    def on_service(self, is_present: bool) -> None:
        """Send the snapshot, even an empty one, to a service that appeared, so that it need not wait."""
        if is_present:
            self._send(self._snapshot)
