"""Records missing and late tracks and frames: in metrics, in the log, and in ``late.csv``."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping

from camsync.clock import Clock
from logthrottle import LogThrottle
from server.service.decision_files.live_decision_writer import LiveDecisionWriter
from server.service.ingest.camera_state import CameraState
from server.service.ingest.epoch_aligner import Epoch
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.view_selection.decider import GopDecision

log = logging.getLogger(__name__)


class LossRecorder:
    """Records what was missing when epochs and GOPs were decided; ``decision_writer`` is optional."""

    def __init__(
        self,
        frame_buffers: Mapping[str, FrameBuffer],
        states: Mapping[str, CameraState],
        stride: int,
        clock: Clock = time.monotonic,
    ) -> None:
        self._frame_buffers, self._states, self._stride = frame_buffers, states, stride
        self._late_logs = {camera: LogThrottle(clock) for camera in frame_buffers}
        self.decision_writer: LiveDecisionWriter | None = None
        self.late_epochs = 0
        """Windows of connected cameras that arrived too late for their epoch."""
        self.lost_frames = dict.fromkeys(frame_buffers, 0)
        """By camera: frames missing in decided GOPs while it was delivering."""
        self._skip_log = LogThrottle(clock)
        self._decided_end: int | None = None
        """The first pulse that is not decided yet."""

    def record_epoch(self, epoch: Epoch) -> None:
        """Record cameras with late tracks, frames without detection, and frames without peers' detections."""
        for camera in epoch.late:
            self.late_epochs += 1
            if (more := self._late_logs[camera].record()) is not None:
                text = "camera %s: its tracks for pulses up to %d arrived too late%s"
                log.warning(text, camera, epoch.last, more)
        for camera, message in epoch.tracks.items():
            self._states[camera].frames_without_peers += len(message.without_peers)
            if ended := self._late_logs[camera].end():
                text = "camera %s: its tracks arrive in time again; %d windows in %.0f s were late"
                log.info(text, camera, ended.count, ended.seconds)
        if self.decision_writer is None:
            return
        for camera in epoch.late:
            self.decision_writer.add_late(
                camera, range(epoch.last - self._stride + 1, epoch.last + 1), "tracks late"
            )
        for camera, message in epoch.tracks.items():
            self.decision_writer.add_late(camera, message.shed, "no detection")
            self.decision_writer.add_late(camera, message.without_peers, "no peer detections")

    def record_gop(self, decision: GopDecision) -> None:
        """Record frames missing in a GOP, of cameras that were delivering."""
        if self._decided_end is not None and decision.first > self._decided_end:
            self._record_skipped(range(self._decided_end, decision.first))
        self._decided_end = decision.first + decision.frames
        for camera, frame_buffer in self._frame_buffers.items():
            lost = frame_buffer.lost(decision.first, decision.frames)
            self.lost_frames[camera] += len(lost)
            if self.decision_writer is not None:
                self.decision_writer.add_late(camera, lost, "no frame")

    def _record_skipped(self, pulses: range) -> None:
        """Record skipped frames, in a single line: there may be millions."""
        if (more := self._skip_log.record()) is not None:
            text = "pulses %d to %d are skipped: they are too old%s"
            log.warning(text, pulses.start, pulses.stop - 1, more)
        if self.decision_writer is not None:
            self.decision_writer.add_late("", [pulses.start], f"not decided up to {pulses.stop}")
