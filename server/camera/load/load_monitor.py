"""A camera's load: by how far its tracking is behind the pulses, and what it leaves out for that."""

from __future__ import annotations

import logging

from server.camera.load.load_shedder import LevelBounds, LoadShedder, ShedLevel, shed_levels
from server.config.site_config import Config

log = logging.getLogger(__name__)

_BEHIND, _ABREAST = 0.25, 0.1
"""Of `track.backlog_s`, besides a frame's own time, which it may take, and the patience with others."""


class LoadMonitor:
    """Asks the load shedder for its level and logs changes; without `track.shed_load` the level stays 0."""

    def __init__(self, config: Config, camera_id: str, *, live: bool) -> None:
        track = config.track
        self._camera, self._stride, self._gop = camera_id, track.window.stride, config.encode.gop
        waits = track.cross_view_wait_s if config.witnesses(camera_id) else 0.0
        waits += 1.0 / config.site.fps
        bounds = LevelBounds(waits + _BEHIND * track.backlog_s, waits + _ABREAST * track.backlog_s)
        all_rungs = shed_levels(self._stride, live=live) if track.shed_load else (ShedLevel(),)
        self._ladder = LoadShedder(all_rungs, bounds)

    @property
    def level(self) -> int:
        """How far up the ladder the camera is; 0: nothing is left out."""
        return self._ladder.level

    @property
    def words(self) -> str:
        """What is left out, for people; empty: nothing."""
        return self._ladder.rung.words

    def searches(self, pulse: int) -> bool:
        """Return whether a frame is searched."""
        return self._ladder.rung.searches(pulse, self._stride)

    def takes(self, pulse: int) -> bool:
        """Return whether a frame is taken at all."""
        return self._ladder.rung.takes(pulse, self._stride, self._gop)

    def measured(self, lag: float, now: float) -> None:
        """Take in how many seconds after its pulse was due a frame had been searched, by a steady clock."""
        before = self.level
        self._ladder.measured(lag, now)
        if self.level > before:
            log.warning("camera %s is %.1f s behind: %s", self._camera, lag, self.words)
        elif self.level < before:
            log.info("camera %s keeps up: %s", self._camera, self.words or "every frame is searched again")
