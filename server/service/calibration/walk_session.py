"""The operator's calibration walk: collects detections while it lasts, then runs the calibration."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from enum import Enum
from typing import Any

from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.service.calibration.calibration_report import comparison_step
from server.service.calibration.coverage import WalkCoverage, walk_coverage
from server.service.calibration.walk_samples import CameraWalk
from server.service.calibration.worker import CalibrationResult, CalibrationTask, run_calibration
from server.service.ingest.epoch_aligner import Epoch

MAX_WALK_S = 600.0
"""Seconds of a walk that are kept; what comes after is left out. One minute is enough."""
_SHIFT_S = 3.0
"""Seconds that cameras may be out of step, as of `myview calibrate`."""

Work = Callable[[CalibrationTask], Coroutine[Any, Any, CalibrationResult]]


class WalkState(Enum):
    """How far the walk is."""

    NONE = "none"
    WALKING = "walking"
    WORKING = "working"
    DONE = "done"


class WalkSession:
    """Takes in every epoch while somebody walks. It has no clock: frames are counted by pulses."""

    def __init__(self, config: Config, work: Work = run_calibration) -> None:
        self._config, self._work = config, work
        self._fps = config.site.fps
        self._trails: dict[str, CameraWalk] = {}
        self._start = 0
        self._last = -1
        """The last pulse that was spoken of."""
        self._epochs = 0
        self._task: asyncio.Task[None] | None = None
        self.state = WalkState.NONE
        self.done: CalibrationResult | None = None
        """What has come of the walk."""

    def take(self, epoch: Epoch) -> None:
        """Take in what all cameras said of an epoch."""
        self._last = epoch.last
        if self.state is not WalkState.WALKING:
            return
        if self.seconds >= MAX_WALK_S:
            return
        if not self._epochs:
            # Before the first word nobody knew how far pulses are; frames are counted from the walk on.
            self._start = max(self._start, epoch.last + 1 - self._config.track.window.stride)
        self._epochs += 1
        for camera, message in epoch.tracks.items():
            self._trails[camera].add(message, self._start)

    def start(self) -> None:
        """Begin a walk with what is seen from now on; another that there was is forgotten."""
        self.stop()
        site = (self._config.site.width, self._config.site.height)
        step = comparison_step(self._fps)
        self._trails = {it: CameraWalk(it, site, step) for it in self._config.camera_ids}
        self._start, self._epochs = self._last + 1, 0
        self.state = WalkState.WALKING

    def go_on(self) -> None:
        """Go on with the walk that there is."""
        self._end_work()
        for trail in self._trails.values():
            trail.pause(self._last + 1 - self._start)
        self.done, self.state = None, WalkState.WALKING

    def finish(self, person: float) -> None:
        """Calibrate from the walk, in which people are `person` metres tall."""
        self._end_work()
        seen = [it.seen for it in self._trails.values()]
        offsets = {
            it.id: it.offset
            for it in self._config.cameras
            if source_kind(it.source) in (SourceKind.FILE, SourceKind.FOLDER)
        }
        task = CalibrationTask([it for it in seen if it is not None], self._fps, _SHIFT_S, person, offsets)
        self.done, self.state = None, WalkState.WORKING
        self._task = asyncio.create_task(self._calibrate(task), name="calibration")

    def stop(self) -> None:
        """Forget the walk and what came of it."""
        self._end_work()
        self._trails, self._epochs = {}, 0
        self.done, self.state = None, WalkState.NONE

    @property
    def seconds(self) -> float:
        """For how long was walked."""
        return self._epochs * self._config.track.window.stride / self._fps

    def coverage(self) -> WalkCoverage:
        """Return the coverage so far."""
        return walk_coverage(list(self._trails.values()), comparison_step(self._fps) / self._fps)

    async def _calibrate(self, task: CalibrationTask) -> None:
        self.done = await self._work(task)
        self.state = WalkState.DONE

    def _end_work(self) -> None:
        if self._task is not None:
            self._task.cancel()
            self._task = None
