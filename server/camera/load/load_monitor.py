"""A camera's load: its tracking lag, and the shedding level that follows from it."""

from __future__ import annotations

import logging

from server.camera.load.load_shedder import LevelBounds, LoadShedder, shed_levels
from server.config.site_config import Config

log = logging.getLogger(__name__)

_BEHIND, _KEEPS_UP = 0.25, 0.1
"""Shares of `track.backlog_s`, beyond one frame interval and the wait for peers."""


class LoadMonitor:
    """Sets the shedding level by the load, and logs its changes; without `track.shed_load` it stays 0."""

    def __init__(self, config: Config, camera_id: str, *, live: bool, has_network: bool = False) -> None:
        track = config.track
        self._camera, self._stride, self._gop = camera_id, config.window.stride, config.gop
        latency_s = track.cross_view_wait_s if config.peers_of(camera_id) else 0.0
        latency_s += 1.0 / config.site.fps
        bounds = LevelBounds(latency_s + _BEHIND * track.backlog_s, latency_s + _KEEPS_UP * track.backlog_s)
        levels = shed_levels(self._stride, live=live, has_network=has_network)
        levels = levels if track.shed_load else levels[:1]
        self._shedder = LoadShedder(levels, bounds)

    @property
    def level(self) -> int:
        """The shedding level; 0: none."""
        return self._shedder.level

    @property
    def description(self) -> str:
        """The shed work as text; empty: none."""
        return self._shedder.current.description

    @property
    def network_factor(self) -> int:
        """Factor of the interval between two runs of the network."""
        return self._shedder.current.network_factor

    def detects(self, pulse: int) -> bool:
        """Return whether detection runs on a frame."""
        return self._shedder.current.detects(pulse, self._stride)

    def captures(self, pulse: int) -> bool:
        """Return whether a frame is captured."""
        return self._shedder.current.captures(pulse, self._stride, self._gop)

    def measure_lag(self, lag: float, now: float) -> None:
        """Update with the seconds from a frame's pulse to its detection, at ``now`` by a steady clock."""
        before = self.level
        self._shedder.measure_lag(lag, now)
        if self.level > before:
            log.warning("camera %s is %.1f s behind: %s", self._camera, lag, self.description)
        elif self.level < before:
            log.info(
                "camera %s keeps up: %s",
                self._camera,
                self.description or "detection runs on every frame again",
            )
