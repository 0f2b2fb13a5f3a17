"""Joint tracking in a process of its own, for live sites: it must not keep viewers waiting."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Collection
from itertools import count

import msgspec

from expbackoff import Backoff
from logthrottle import LogThrottle
from server.config.site_config import Config
from server.service.ingest.epoch_aligner import Epoch
from server.service.joint_tracking.epochs import joint_setup, joint_task, with_joint_tracks, without_tracks
from server.service.joint_tracking.joint_messages import JointSetup, JointTracks
from server.system.worker.process import WorkerDiedError, WorkerProcess

log = logging.getLogger(__name__)

_RETRY_FIRST_S, _RETRY_MAX_S = 0.5, 30.0
_ANSWER_S = 10.0
"""A process that takes longer for an epoch hangs: it is replaced."""


class JointWorker:
    """Replaces the own tracks of the cameras of the common ground by joint ones, epoch by epoch.

    If the process dies it is replaced, and people are known again by where they are and how they look. Until
    then epochs have no tracks in these cameras; a process that dies again and again is replaced less often.
    """

    def __init__(self, config: Config) -> None:
        self._cameras = config.joint_cameras
        self._setup = joint_setup(config) if self._cameras else None
        self._joint = set(self._cameras)
        """The cameras that overlap, as far as is known: all, until the process says."""
        self._logged: set[str] = set()
        self._runs = count()
        self._worker: WorkerProcess[JointTracks] | None = None
        self._failures = LogThrottle()
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
        if self._worker is not None or asyncio.get_running_loop().time() >= self._retry_at:
            task = joint_task(epoch, self._cameras)
            try:
                worker = await self._running(self._setup)
                joint = await worker.ask(task)
                self._backoff.reset()
            except WorkerDiedError as error:
                await self._replace(error)
            else:
                self._joint = self._joint - task.cameras.keys() | joint.cameras.keys()
                self._log_joint_cameras(joint.cameras)
                return with_joint_tracks(epoch, joint)
        return without_tracks(epoch, self._joint)

    def _log_joint_cameras(self, cameras: Collection[str]) -> None:
        """Log which cameras are tracked jointly, when more are."""
        if not self._logged.issuperset(cameras):
            self._logged |= set(cameras)
            names = [camera for camera in self._cameras if camera in self._logged]
            log.info("cameras %s are tracked jointly on their common ground", ", ".join(names))

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
