"""Joint tracking in a process of its own, for live sites: it must not keep viewers waiting."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Collection
from itertools import count

import msgspec

from expbackoff import Backoff
from logthrottle import LogThrottle
from server.config.site_config import Config
from server.service.ingest.epoch_aligner import Epoch
from server.service.joint_tracking.epochs import (
    joint_setup,
    joint_task,
    merge_tasks,
    with_joint_tracks,
    without_tracks,
)
from server.service.joint_tracking.joint_messages import JointSetup, JointTask, JointTracks
from server.system.worker.process import WorkerDiedError, WorkerProcess

log = logging.getLogger(__name__)

_RETRY_FIRST_S, _RETRY_MAX_S = 0.5, 30.0
_ANSWER_S = 10.0
"""A process that takes longer for an epoch hangs: it is replaced."""
_LATE_S, _LATE_MAX_S = 0.6, 5.0
"""Limits of the seconds after which an epoch is decided without joint tracks."""
_DISAGREEING_M = 0.5
"""Meters of a camera's offset from which on it should be calibrated again."""
_UNSENT_MAX = 32
"""Epochs that wait for a process that is late; those of earlier ones are lost."""
_LATE_FACTOR, _SLOWEST_KEPT = 2.0, 0.95
"""An answer is late that takes so many times as long as the slowest one, of which this share counts for the
next: on a busy machine answers take longer, and nobody is to vanish there."""


class JointWorker:
    """Replaces the own tracks of the cameras of the common ground by joint ones, epoch by epoch.

    If the process dies it is replaced, and people are known again by where they are and how they look. Until
    then, and while it is late, epochs have no tracks in these cameras: decisions do not wait, but the
    process still gets what was observed meanwhile. A process that
    dies again and again is replaced less often.
    """

    def __init__(self, config: Config) -> None:
        self._cameras = config.joint_cameras
        self._setup = joint_setup(config) if self._cameras else None
        self._joint = set(self._cameras)
        """The cameras that overlap, as far as is known: all, until the process says."""
        self._logged: set[str] = set()
        self.offsets: dict[str, float] = {}
        """By camera, meters by which it disagrees with the others about where people stand,
        which is corrected."""
        self._runs = count()
        self._worker: WorkerProcess[JointTracks] | None = None
        self._answer: asyncio.Task[JointTracks] | None = None
        """To the last task, while the process works on it."""
        self._unsent = deque[JointTask](maxlen=_UNSENT_MAX)
        """Tasks of epochs that were decided meanwhile: who was seen in them is still to be known."""
        self._least_patience_s = max(_LATE_S, config.track.cross_view_wait_s)
        self._slowest_s = 0.0
        """The slowest of the last answers, seconds."""
        self._failures, self._late, self._disagreements = LogThrottle(), LogThrottle(), LogThrottle()
        self._backoff = Backoff(_RETRY_FIRST_S, _RETRY_MAX_S)
        self._retry_at = 0.0
        """When to start a process at the earliest, by the loop's clock."""

    async def start(self) -> None:
        """Start the process, so that it loads its libraries before the first epoch is there."""
        if self._setup is not None:
            try:
                await self._running(self._setup)
            except WorkerDiedError as error:
                await self._replace(error)

    async def step(self, epoch: Epoch) -> Epoch:
        """Return the epoch with joint tracks; unchanged where no cameras are tracked jointly."""
        if self._setup is None:
            return epoch
        self._unsent.append(joint_task(epoch, self._cameras))
        if not await self._is_idle():
            return without_tracks(epoch, self._joint)
        task = merge_tasks(self._unsent)
        self._unsent.clear()
        self._answer = asyncio.create_task(self._ask(task, self._setup), name="joint tracking")
        await asyncio.wait({self._answer}, timeout=self._patience_s)
        if not self._answer.done():
            if self._logged and (more := self._late.record()) is not None:
                log.warning(
                    "the process that tracks jointly is late%s: its cameras show nobody meanwhile", more
                )
            return without_tracks(epoch, self._joint)
        joint = await self._take_answer()
        if joint is None:
            return without_tracks(epoch, self._joint)
        self._joint = self._joint - task.cameras.keys() | joint.cameras.keys()
        self._log_joint_cameras(joint.cameras)
        self._take_offsets(joint.offsets)
        return with_joint_tracks(epoch, joint)

    async def _is_idle(self) -> bool:
        """Return whether the process can be asked: not if it is late, or is started again only later."""
        if self._answer is not None:
            if not self._answer.done():
                return False
            await self._take_answer()  # to an epoch that has been decided without it
        return self._worker is not None or asyncio.get_running_loop().time() >= self._retry_at

    @property
    def _patience_s(self) -> float:
        """Seconds for which an epoch waits for joint tracks."""
        return max(self._least_patience_s, min(_LATE_FACTOR * self._slowest_s, _LATE_MAX_S))

    async def _ask(self, task: JointTask, setup: JointSetup) -> JointTracks:
        worker, loop = await self._running(setup), asyncio.get_running_loop()
        await worker.wait_until_ready()
        asked = loop.time()
        joint = await worker.ask(task)
        self._slowest_s = max(loop.time() - asked, _SLOWEST_KEPT * self._slowest_s)
        return joint

    async def _take_answer(self) -> JointTracks | None:
        """Return the answer that is there; None: the process has died, and is replaced."""
        assert self._answer is not None  # noqa: S101 — callers have asked
        answer, self._answer = self._answer, None
        try:
            joint = answer.result()
        except WorkerDiedError as error:
            await self._replace(error)
            return None
        self._backoff.reset()
        return joint

    def _log_joint_cameras(self, cameras: Collection[str]) -> None:
        """Log which cameras are tracked jointly, when more are."""
        if not self._logged.issuperset(cameras):
            self._logged |= set(cameras)
            names = [camera for camera in self._cameras if camera in self._logged]
            log.info("cameras %s are tracked jointly on their common ground", ", ".join(names))

    def _take_offsets(self, offsets: dict[str, float]) -> None:
        """Log the camera that disagrees most with the others, if it does so by too much."""
        self.offsets = offsets
        worst = max(offsets, key=lambda camera: offsets[camera], default="")
        if (
            worst
            and offsets[worst] >= _DISAGREEING_M
            and (more := self._disagreements.record(worst)) is not None
        ):
            text = (
                "camera %s sees people %.1f m from where the others see them%s: calibrate the cameras again"
            )
            log.warning(text, worst, offsets[worst], more)

    async def _replace(self, error: WorkerDiedError) -> None:
        """End the process; the next one starts at once, and later if that fails, too."""
        if (more := self._failures.record(str(error))) is not None:
            log.warning("the process that tracks jointly %s%s: it is started anew", error, more)
        is_first, delay = not self._backoff.failures, self._backoff.next()
        self._retry_at = asyncio.get_running_loop().time() + (0.0 if is_first else delay)
        await self.close()

    @property
    def pid(self) -> int | None:
        """The id of the process; None: it does not run."""
        return None if self._worker is None else self._worker.pid

    async def close(self) -> None:
        """End the process."""
        answer, self._answer = self._answer, None
        if answer is not None:
            answer.cancel()
            await asyncio.gather(answer, return_exceptions=True)
        worker, self._worker = self._worker, None
        if worker is not None:
            await worker.kill()

    async def _running(self, setup: JointSetup) -> WorkerProcess[JointTracks]:
        if self._worker is None:
            setup = msgspec.structs.replace(setup, run=next(self._runs))
            self._worker = await WorkerProcess.start(
                "server.service.joint_tracking", setup, JointTracks, _ANSWER_S
            )
        return self._worker
