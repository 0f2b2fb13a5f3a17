"""The state of a camera as the best-view service knows it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from datetime import datetime

from server.messaging.camera_status import (
    SUBSTREAM_AWAY,
    CameraStatus,
    RetryCause,
    motion_text,
    picture_text,
)
from server.service.metrics.camera_metrics import CameraMetrics


@dataclass(frozen=True, slots=True)
class Unavailability:
    """Why a camera's process cannot use its source, and when it opens it again."""

    reason: str
    """For the operator: it may name addresses."""
    cause: RetryCause
    retry_at: float
    """Unix seconds by this service's clock."""

    @property
    def retry_s(self) -> float:
        """Seconds until then; 0: it is being opened."""
        return max(0.0, self.retry_at - time.time())


@dataclass(slots=True)
class CameraState:
    """The state of a camera as the best-view service knows it."""

    metrics: CameraMetrics
    """Measurements for the operator."""
    alive: bool = False
    refused: str = ""
    """Why its frames are refused; empty: they are used."""
    unavailable: Unavailability | None = None
    """None: its process is connected, or tells nothing."""
    stream_changes: int = 0
    """How often its source was opened again because what it sends had changed."""
    status: CameraStatus | None = None
    ended: bool = False
    bad_messages: int = 0
    frames: int = 0
    frames_without_peers: int = 0
    """Frames that were tracked without another camera's detections."""

    @property
    def label(self) -> str:
        """The state in one word: refused, ended, starting, live or gone."""
        if self.refused:
            return "refused"
        if self.ended:
            return "ended"
        if not self.frames:
            return "starting"
        return "live" if self.alive and not self.is_source_away else "gone"

    @property
    def is_source_away(self) -> bool:
        """Whether its source delivers no frames, by the last status of its connected process."""
        return self.status is not None and self.status.state == "away"

    @property
    def message(self) -> str:
        """A message to the operator about a problem; empty: none."""
        if self.refused:
            return self.refused
        if self.alive and self.is_source_away:
            return "its source delivers no frames; retrying"
        if not self.alive or self.status is None:
            return ""
        texts = [SUBSTREAM_AWAY if self.status.substream == "away" else "", self.status.load]
        if self.status.condition != "clear" or self.status.covered_share:
            texts.insert(0, picture_text(self.status.condition, self.status.covered_share))
        if self.status.motion is not None:
            since = datetime.fromtimestamp(self.status.motion_since).astimezone()
            texts.insert(0, f"{motion_text(self.status.motion)} since {since:%H:%M}: calibrate it again")
        return "; ".join(filter(None, texts))

    def count_bad_message(self, reason: Exception | str) -> None:
        """Count an invalid message."""
        self.bad_messages += 1
        self.metrics.record_problem(f"invalid message: {reason}")
