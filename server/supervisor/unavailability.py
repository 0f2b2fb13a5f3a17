"""Tells the best-view services why a camera cannot be opened, while its process tries again."""

from __future__ import annotations

import msgspec

from server.config.site_config import Config
from server.messaging.bus import Bus
from server.messaging.camera_status import REASON_MAX, UnavailableCamera
from server.messaging.messages import ZenohKeys


class UnavailabilityReport:
    """Sends the present reason after each attempt, and to each service that connects.

    It has a connection of its own, from the first reason on until it is closed.
    """

    def __init__(self, config: Config, camera_id: str) -> None:
        self._config, self._id = config, camera_id
        self._keys = ZenohKeys(config.site.name)
        self._bus: Bus | None = None
        self._message = b""

    def send(self, reason: str) -> None:
        """Send why the camera cannot be opened.

        Raises:
            UserError: the bus's address is not supported.
        """
        line = " ".join(reason.removeprefix(f"camera {self._id}: ").split())[:REASON_MAX]
        self._message = msgspec.msgpack.encode(UnavailableCamera(reason=line))
        if self._bus is None:
            self._bus = Bus.client(self._config.zenoh, self._id)
            self._bus.watch_alive(self._keys.bestview("**"), self._on_service)
        else:
            self._publish()

    def close(self) -> None:
        """Disconnect."""
        if self._bus is not None:
            self._bus.close()

    def _on_service(self, _: str, is_present: bool) -> None:
        if is_present:
            self._publish()

    def _publish(self) -> None:
        if self._bus is not None:
            self._bus.publish(self._keys.camera(self._id, "unavailable"), self._message)
