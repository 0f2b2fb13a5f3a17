"""Repeated late tracks are one event of the log, and each is counted."""

from __future__ import annotations

import pytest

from fakes.service.scripted_cameras import CAMERAS, FPS, STRIDE, camera_tracks, epoch_of
from server.media.stream_format import StreamFormat
from server.service.ingest.camera_state import CameraState
from server.service.ingest.epoch_aligner import Epoch
from server.service.ingest.loss_recorder import LossRecorder
from server.service.metrics.camera_metrics import CameraMetrics
from server.service.streaming.frame_buffer import FrameBuffer

A, B = CAMERAS


class LossyEpochs:
    """Records the losses of some epochs, each at its time."""

    def __init__(self) -> None:
        self.now = 0.0
        frame_buffers = {camera: FrameBuffer(FPS, 50, StreamFormat()) for camera in CAMERAS}
        states = {camera: CameraState(CameraMetrics(FPS)) for camera in CAMERAS}
        self.loss_recorder = LossRecorder(frame_buffers, states, STRIDE, lambda: self.now)

    def epochs(self, numbers: range, late: str | None = None) -> None:
        """Decide epochs that all cameras but one have reported."""
        for number in numbers:
            self.now = number * STRIDE / FPS
            messages = [camera_tracks(camera, number, {}) for camera in CAMERAS if camera != late]
            epoch = epoch_of(number, *messages)
            late_ones = () if late is None else (late,)
            self.loss_recorder.record_epoch(Epoch(epoch.number, epoch.last, epoch.tracks, late_ones))


def test_a_period_of_late_tracks_is_logged_at_its_start_and_end(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level("INFO")
    lossy, minute = LossyEpochs(), round(60 * FPS / STRIDE)
    for ten in range(0, 100, 10):  # some arrive in time in between
        lossy.epochs(range(ten, ten + 4), late=B)
        lossy.epochs(range(ten + 4, ten + 10))
    lossy.epochs(range(100, 100 + minute))
    [start, over] = caplog.records
    assert (start.levelname, over.levelname) == ("WARNING", "INFO")
    assert start.getMessage() == f"camera {B}: its tracks for pulses up to {STRIDE - 1} arrived too late"
    seconds = 93 * STRIDE / FPS
    assert over.getMessage() == (
        f"camera {B}: its tracks arrive in time again; 40 windows in {seconds:.0f} s were late"
    )
    assert lossy.loss_recorder.late_epochs == 40


def test_each_camera_is_logged_separately(caplog: pytest.LogCaptureFixture) -> None:
    lossy = LossyEpochs()
    lossy.epochs(range(5), late=A)
    lossy.epochs(range(5, 10), late=B)
    assert [message.partition(":")[0] for message in caplog.messages] == [f"camera {A}", f"camera {B}"]


def test_a_camera_that_has_disconnected_is_not_logged_as_in_time(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    lossy = LossyEpochs()
    lossy.epochs(range(3), late=B)
    lossy.now += 1000.0
    lossy.loss_recorder.record_epoch(epoch_of(9, camera_tracks(A, 9, {})))
    assert len(caplog.messages) == 1
