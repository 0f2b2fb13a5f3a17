"""Joint tracking in a process of its own, for live sites: it must not keep viewers waiting."""

from __future__ import annotations

import logging
from itertools import count

import msgspec

from logthrottle import LogThrottle
from server.config.site_config import Config
from server.service.ingest.epoch_aligner import Epoch
from server.service.joint_tracking.epochs import joint_setup, joint_task, with_joint_tracks
from server.service.joint_tracking.joint_messages import JointSetup, JointTracks
from server.system.worker.process import WorkerDiedError, WorkerProcess

log = logging.getLogger(__name__)

_ANSWER_S = 10.0
"""A process that takes longer for an epoch hangs: it is replaced."""


class JointWorker:
    """Replaces the own tracks of the cameras of the common ground by joint ones, epoch by epoch.

    If the process dies it is replaced, and people are known again by where they are and how they look.
    """

    def __init__(self, config: Config) -> None:
        self._cameras = config.joint_cameras
        self._setup = joint_setup(config) if self._cameras else None
        self._runs = count()
        self._worker: WorkerProcess[JointTracks] | None = None
        self._failures = LogThrottle()

    async def step(self, epoch: Epoch) -> Epoch:
        """Return the epoch with joint tracks; unchanged where no cameras are tracked jointly."""
        if self._setup is None:
            return epoch
        try:
            worker = await self._running(self._setup)
            joint = await worker.ask(joint_task(epoch, self._cameras))
        except WorkerDiedError as error:
            if (more := self._failures.record(str(error))) is not None:
                log.warning("the process that tracks jointly %s%s: it is started anew", error, more)
            await self.close()
            joint = None
        return with_joint_tracks(epoch, self._cameras, joint)

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
