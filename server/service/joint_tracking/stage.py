"""Joint tracking in this process, for recordings."""

from __future__ import annotations

from server.config.site_config import Config
from server.service.ingest.epoch_aligner import Epoch
from server.service.joint_tracking.epochs import joint_setup, joint_task, with_joint_tracks
from server.service.joint_tracking.joint_tracker import JointTracker


class JointStage:
    """Replaces the own tracks of the cameras of the common ground by joint ones, epoch by epoch."""

    def __init__(self, config: Config) -> None:
        self._cameras = config.joint_cameras
        self._tracker = JointTracker(joint_setup(config)) if self._cameras else None

    def step(self, epoch: Epoch) -> Epoch:
        """Return the epoch with joint tracks; unchanged where no cameras are tracked jointly."""
        if self._tracker is None:
            return epoch
        return with_joint_tracks(epoch, self._tracker.step(joint_task(epoch, self._cameras)))
