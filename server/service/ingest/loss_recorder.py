"""What did not come, or not in time: counted, said in the log, and written into `late.csv`."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping

from camsync.clock import Clock
from logthrottle import LogThrottle
from server.service.decision_files.live_decision_writer import LiveDecisionWriter
from server.service.ingest.epoch_aligner import Epoch
from server.service.ingest.ingest import CameraState
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.view_selection.decider import GopDecision

log = logging.getLogger(__name__)


class LossRecorder:
    """Records what was missing when a GOP was decided, in ``recorder`` too once there is one."""

    def __init__(
        self,
        frame_buffers: Mapping[str, FrameBuffer],
        states: Mapping[str, CameraState],
        stride: int,
        clock: Clock = time.monotonic,
    ) -> None:
        self._shelves, self._states, self._stride = frame_buffers, states, stride
        self._late = {camera: LogThrottle(clock) for camera in frame_buffers}
        self.recorder: LiveDecisionWriter | None = None
        self.late_epochs = 0
        """Windows that were decided without a camera that was there."""
        self.lost_pictures = dict.fromkeys(frame_buffers, 0)
        """By camera: pictures of decided GOPs that did not come though it was delivering."""
        self._holes = LogThrottle(clock)
        self._until: int | None = None
        """The first pulse of which nothing is decided yet."""

    def epoch(self, epoch: Epoch) -> None:
        """Note whose tracks are late, and what cameras say that they did not do or hear."""
        for camera in epoch.late:
            self.late_epochs += 1
            if (more := self._late[camera].record()) is not None:
                told = "camera %s: its tracks for pulses up to %d came too late%s"
                log.warning(told, camera, epoch.last, more)
        for camera, message in epoch.tracks.items():
            self._states[camera].unheard += len(message.without_peers)
            if ended := self._late[camera].end():
                told = "camera %s: its tracks come in time again; those of %d windows in %.0f s did not"
                log.info(told, camera, ended.count, ended.seconds)
        if self.recorder is None:
            return
        for camera in epoch.late:
            self.recorder.late(camera, range(epoch.last - self._stride + 1, epoch.last + 1), "tracks late")
        for camera, message in epoch.tracks.items():
            self.recorder.late(camera, message.shed, "not searched")
            self.recorder.late(camera, message.without_peers, "others not heard")

    def gop(self, decision: GopDecision) -> None:
        """Note the pictures of a GOP that did not come, of cameras that were delivering."""
        if self._until is not None and decision.first > self._until:
            self._hole(range(self._until, decision.first))
        self._until = decision.first + decision.frames
        for camera, frame_buffer in self._shelves.items():
            lost = frame_buffer.missing(decision.first, decision.frames)
            self.lost_pictures[camera] += len(lost)
            if self.recorder is not None:
                self.recorder.late(camera, lost, "no picture")

    def _hole(self, pulses: range) -> None:
        """Note frames that are past and left out: in one line, there may be millions."""
        if (more := self._holes.record()) is not None:
            told = "pulses %d to %d are not decided: they were long past%s"
            log.warning(told, pulses.start, pulses.stop - 1, more)
        if self.recorder is not None:
            self.recorder.late("", [pulses.start], f"not decided up to {pulses.stop}")
