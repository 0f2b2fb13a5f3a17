"""The operator's calibration walk: collects detections while it lasts, then runs the calibration."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from enum import Enum
from typing import Any

from bestview.calibration import comparison_step
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.service.calibration.coverage import WalkCoverage, walk_coverage
from server.service.calibration.walk_samples import CalibrationWalk
from server.service.calibration.worker import CalibrationResult, CalibrationTask, run_calibration
from server.service.ingest.epoch_aligner import Epoch

MAX_WALK_S = 600.0
"""The longest walk, in seconds; later boxes are ignored. One minute is enough."""
_SHIFT_S = 3.0
"""The largest time offset between cameras, in seconds, as in `myview calibrate`."""

Calibrate = Callable[[CalibrationTask], Coroutine[Any, Any, CalibrationResult]]


class WalkState(Enum):
    """The state of a walk."""

    NONE = "none"
    WALKING = "walking"
    WORKING = "working"
    DONE = "done"


class WalkSession:
    """Collects boxes while a person walks through the site. It has no clock: frames are counted by pulses."""

    def __init__(self, config: Config, calibrate: Calibrate = run_calibration) -> None:
        self._config, self._run_calibration = config, calibrate
        self._fps = config.site.fps
        self._walks: dict[str, CalibrationWalk] = {}
        self._start = 0
        self._last = -1
        """The last pulse of the last epoch."""
        self._epochs = 0
        self._task: asyncio.Task[None] | None = None
        self._unfinished: set[asyncio.Task[None]] = set()
        """The running calibration, and those that were cancelled and are ending their process."""
        self.state = WalkState.NONE
        self.result: CalibrationResult | None = None
        """The result of the calibration; None: it has not finished."""

    def add(self, epoch: Epoch) -> None:
        """Add the cameras' boxes of an epoch."""
        self._last = epoch.last
        if self.state is not WalkState.WALKING:
            return
        if self.seconds >= MAX_WALK_S:
            return
        if not self._epochs:
            # The pulse number is unknown before the first epoch; frames are counted from the walk's start.
            self._start = max(self._start, epoch.last + 1 - self._config.window.stride)
        self._epochs += 1
        for camera, message in epoch.tracks.items():
            self._walks[camera].add(message, self._start)

    def start(self) -> None:
        """Start a walk; an earlier one is discarded."""
        self.discard()
        site = (self._config.site.width, self._config.site.height)
        step = comparison_step(self._fps)
        self._walks = {camera: CalibrationWalk(camera, site, step) for camera in self._config.camera_ids}
        self._start, self._epochs = self._last + 1, 0
        self.state = WalkState.WALKING

    def resume(self) -> None:
        """Continue the walk."""
        self._cancel_calibration()
        for walk in self._walks.values():
            walk.ignore_before(self._last + 1 - self._start)
        self.result, self.state = None, WalkState.WALKING

    def finish(self, person_height: float) -> None:
        """Calibrate from the walk of a person who is ``person_height`` meters tall."""
        self._cancel_calibration()
        boxes = [walk.boxes for walk in self._walks.values()]
        offsets = {
            camera.id: camera.first_pulse(self._fps)
            for camera in self._config.cameras
            if source_kind(camera.source) in (SourceKind.FILE, SourceKind.FOLDER)
        }
        task = CalibrationTask(
            [camera_boxes for camera_boxes in boxes if camera_boxes is not None],
            self._fps,
            _SHIFT_S,
            person_height,
            offsets,
        )
        self.result, self.state = None, WalkState.WORKING
        self._task = asyncio.create_task(self._calibrate(task), name="calibration")
        self._unfinished.add(self._task)
        self._task.add_done_callback(self._unfinished.discard)

    def discard(self) -> None:
        """Discard the walk and its result."""
        self._cancel_calibration()
        self._walks, self._epochs = {}, 0
        self.result, self.state = None, WalkState.NONE

    async def close(self) -> None:
        """Discard the walk, and wait until no calibration process is left."""
        self.discard()
        await asyncio.gather(*self._unfinished, return_exceptions=True)

    @property
    def seconds(self) -> float:
        """The duration of the walk."""
        return self._epochs * self._config.window.stride / self._fps

    def coverage(self) -> WalkCoverage:
        """Return the coverage so far."""
        return walk_coverage(list(self._walks.values()), comparison_step(self._fps) / self._fps)

    async def _calibrate(self, task: CalibrationTask) -> None:
        self.result = await self._run_calibration(task)
        self.state = WalkState.DONE

    def _cancel_calibration(self) -> None:
        if self._task is not None:
            self._task.cancel()
            self._task = None
