"""The process that tracks jointly: it answers the observations of an epoch with tracks."""

from __future__ import annotations

from typing import BinaryIO

from server.service.joint_tracking.joint_messages import JointSetup, JointTask
from server.service.joint_tracking.joint_tracker import JointTracker
from server.system.worker.main import answer_requests, run_worker


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Track epoch by epoch until the service closes the pipe, or ends."""
    answer_requests(requests, answers, JointSetup, JointTask, lambda setup: JointTracker(setup).step)


if __name__ == "__main__":
    run_worker("ground", serve)
