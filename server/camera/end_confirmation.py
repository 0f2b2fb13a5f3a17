"""Waits, at the end of a recording, until the best-view services have received the last tracks."""

from __future__ import annotations

import asyncio

import msgspec

from server.messaging.bus import Bus
from server.messaging.inbox import Message
from server.messaging.messages import DECODE_ERRORS, EndReceived, ZenohKeys

_DECODER = msgspec.msgpack.Decoder(EndReceived)


class EndConfirmation:
    """Collects the services' confirmations that they have received the end of this camera's recording.

    A camera must not disconnect before: zenoh sends that a session ends ahead of messages that wait, and a
    service does not wait for the tracks of a camera that is gone.
    """

    def __init__(self, camera_id: str, boot: int) -> None:
        self._camera, self._boot = camera_id, boot
        self._services: set[str] = set()
        """Keys of the services' liveliness tokens that are present."""
        self._confirmed: set[str] = set()
        self._changed = asyncio.Event()

    def listen(self, bus: Bus, keys: ZenohKeys) -> None:
        """Receive confirmations and the services' presence."""
        bus.subscribe(keys.camera(self._camera, "end_received"), self.receive)
        bus.watch_alive(keys.bestview("**"), self.on_service)

    def receive(self, message: Message) -> None:
        """Record a service's confirmation, unless it cannot be parsed or is for an earlier run."""
        try:
            received = _DECODER.decode(message.payload)
        except DECODE_ERRORS:
            return
        if received.boot == self._boot:
            self._confirmed.add(received.service)
            self._changed.set()

    def on_service(self, key: str, is_present: bool) -> None:
        """Record that a service appeared or disappeared."""
        (self._services.add if is_present else self._services.discard)(key)
        self._changed.set()

    async def wait(self, timeout_s: float) -> bool:
        """Wait until all services that are present have confirmed; return whether they have in time."""
        try:
            async with asyncio.timeout(timeout_s):
                while not self._services <= self._confirmed:
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            return False
        return True
