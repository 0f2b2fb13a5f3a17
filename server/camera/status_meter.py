"""Counters for a camera's status message."""

from __future__ import annotations

import time
from collections import deque

from camsync import PulseClient
from server.camera.load.load_monitor import LoadMonitor
from server.messaging.camera_status import CameraState, CameraStatus

_SPAN_S = 2.0
"""Seconds over which the frame rate is measured."""


class StatusMeter:
    """Counts frames, missed pulses and shed frames."""

    def __init__(self, fps: float) -> None:
        self._times: deque[float] = deque(maxlen=max(2, round(2 * _SPAN_S * fps)))
        self.pulse = -1
        """The newest pulse."""
        self._missed = 0
        self._shed = 0
        self._client: PulseClient | None = None

    def set_client(self, client: PulseClient) -> None:
        """Use this client's clock offset and round trip."""
        self._client = client

    def count_frame(self, pulse: int, missed: int) -> None:
        """Count a frame, and the pulses missed before it."""
        self.pulse = pulse
        self._missed += missed
        self._times.append(time.monotonic())

    def count_missed(self, pulse: int, count: int) -> None:
        """Count pulses without a frame."""
        self.pulse = pulse
        self._missed += count

    def count_skipped_detection(self) -> None:
        """Count a frame whose detection was skipped."""
        self._shed += 1

    def status(
        self, camera: str, boot: int, state: CameraState, waiting: int, load: LoadMonitor
    ) -> CameraStatus:
        """Return the camera's status; ``waiting`` is the number of frames queued for detection."""
        sync = self._client.status() if self._client is not None else None
        since = time.monotonic() - _SPAN_S
        return CameraStatus(
            camera=camera,
            boot=boot,
            state=state,
            pulse=self.pulse,
            fps=sum(moment >= since for moment in self._times) / _SPAN_S,
            missed=self._missed,
            shed=self._shed,
            waiting=waiting,
            load_level=load.level,
            load=load.description,
            synchronized=sync is not None and sync.connected,
            clock_offset=(sync.offset if sync is not None else None) or 0.0,
            round_trip=(sync.round_trip if sync is not None else None) or 0.0,
        )
