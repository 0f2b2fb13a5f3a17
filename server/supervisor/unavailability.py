"""Tells the best-view services why a camera's source cannot be used, and when it is opened again."""

from __future__ import annotations

import time

import msgspec

from server.config.site_config import Config
from server.messaging.bus import Bus
from server.messaging.camera_status import RetryCause, RetryPause
from server.messaging.messages import ZenohKeys


class UnavailabilityReport:
    """Sends the present reason before each pause, and to each service that connects.

    It has a connection of its own, from the first reason on until it is closed.
    """

    def __init__(self, camera_id: str) -> None:
        self._id = camera_id
        self._bus: Bus | None = None
        self._key = ""
        self._pause = RetryPause("", "unopened", 0.0)

    def send(self, config: Config, reason: str, cause: RetryCause, retry_s: float) -> None:
        """Send why the camera cannot be used, and that it is opened again in so many seconds.

        Raises:
            UserError: the bus's address is not supported.
        """
        reason = reason.removeprefix(f"camera {self._id}: ")
        self._pause = RetryPause(reason, cause, time.monotonic() + retry_s)
        if self._bus is None:
            keys = ZenohKeys(config.site.name)
            self._key = keys.camera(self._id, "unavailable")
            self._bus = Bus.client(config.zenoh, self._id)
            self._bus.watch_alive(keys.bestview("**"), self._on_service)
        else:
            self._publish()

    def close(self) -> None:
        """Disconnect."""
        if self._bus is not None:
            self._bus.close()
            self._bus = None

    def _on_service(self, _: str, is_present: bool) -> None:
        if is_present:
            self._publish()

    def _publish(self) -> None:
        if self._bus is not None:
            self._bus.publish(self._key, msgspec.msgpack.encode(self._pause.message()))
