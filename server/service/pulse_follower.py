"""The best-view service's pulses: the newest one, and the time since a pulse was due."""

from __future__ import annotations

import ssl
import time
from collections.abc import Callable

from camsync import Credentials, PulseClient
from server.config.pulse_access import bestview_client_name, pulse_client_tls, pulse_credentials
from server.config.site_config import Config


class PulseFollower:
    """Follows the pulse server's pulses."""

    def __init__(self, config: Config) -> None:
        self._config, self._fps = config, config.site.fps
        self._name = bestview_client_name(config.view.sharding.index)
        self.newest = -1
        """The newest pulse; -1 before the first."""
        self.pulse0: float | None = None
        """When pulse 0 was due, unix seconds; None before the first pulse."""
        self.received_at: float | None = None
        """When the newest pulse was received, by the monotonic clock."""
        self._clock: Callable[[], float] = time.time
        """The pulse clock, once connected: it does not jump when the system clock is set."""
        self.credentials: Credentials | None = None
        self.tls: ssl.SSLContext | None = None

    def load_credentials(self) -> None:
        """Read what is needed to log in to the pulse server.

        Raises:
            UserError: the password file or the authority's certificate cannot be read.
        """
        self.credentials = pulse_credentials(self._config, self._name)
        self.tls = pulse_client_tls(self._config)

    async def follow(self, on_pulse: Callable[[], None]) -> None:
        """Follow the pulses until cancelled, and call back after each."""
        sync = self._config.sync
        async with PulseClient(
            sync.host,
            sync.port,
            self._name,
            fps_hint=self._fps,
            credentials=self.credentials,
            tls=self.tls,
        ) as pulses:
            self._clock = pulses.client_now
            async for pulse in pulses:
                self.newest = pulse.number
                self.pulse0 = pulse.due - pulse.number / self._fps
                self.received_at = time.monotonic()
                on_pulse()

    @property
    def seconds_since_newest(self) -> float | None:
        """Seconds since the newest pulse was received; None before the first."""
        return None if self.received_at is None else time.monotonic() - self.received_at

    def seconds_since(self, pulse: int) -> float | None:
        """Return the seconds since a pulse was due; None before the first pulse."""
        return None if self.pulse0 is None else self._clock() - self.pulse0 - pulse / self._fps
