"""The state of a camera as the best-view service knows it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from types import MappingProxyType

from server.messaging.camera_status import (
    SUBSTREAM_AWAY,
    CameraStatus,
    RetryCause,
    UnavailableCamera,
    motion_text,
    picture_text,
)
from server.service.metrics.camera_metrics import CameraMetrics

_CAUSE_TEXTS: Mapping[RetryCause, str] = MappingProxyType(
    {
        "unopened": "its source cannot be opened",
        "changed": "what its source sends has changed",
        "lost": "its source delivers no frames",
    }
)
_SAME_MOMENT_S = 0.5
"""Messages about one pause take different times, which must not move its end."""


@dataclass(frozen=True, slots=True)
class Unavailability:
    """Why a camera's process cannot use its source, and when it opens it again."""

    reason: str
    """For the operator: it may name addresses."""
    cause: RetryCause
    retry_at: float
    """Unix seconds by this service's clock."""
    message: str
    """For any viewer: without addresses."""

    @classmethod
    def told(cls, message: UnavailableCamera, before: Unavailability | None) -> Unavailability:
        """Take in a message that has just been received."""
        text, retry_at = _CAUSE_TEXTS[message.cause], time.time() + message.retry_s
        if before is not None and abs(before.retry_at - retry_at) < _SAME_MOMENT_S:
            retry_at = before.retry_at
        if not message.address:
            return cls(message.reason, message.cause, retry_at, text)
        reason = f"{message.address}: {message.reason}"
        return cls(reason, message.cause, retry_at, f"{text}: {message.reason}")

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
    """None: its source delivers frames, or its process tells nothing."""
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
        """A message to viewers about a problem; empty: none."""
        if self.refused:
            return self.refused
        if self.unavailable is not None:
            return self.unavailable.message
        if self.alive and self.is_source_away:
            return _CAUSE_TEXTS["lost"]
        if not self.alive or self.status is None:
            return ""
        texts = [SUBSTREAM_AWAY if self.status.substream == "away" else "", self.status.load]
        if self.status.condition != "clear" or self.status.covered_share:
            texts.insert(0, picture_text(self.status.condition, self.status.covered_share))
        if self.status.motion is not None:
            since = datetime.fromtimestamp(self.status.motion_since).astimezone()
            texts.insert(0, f"{motion_text(self.status.motion)} since {since:%H:%M}: calibrate it again")
        return "; ".join(filter(None, texts))

    @property
    def operator_message(self) -> str:
        """A message to the operator about a problem: it may name addresses; empty: none."""
        return self.unavailable.reason if self.unavailable and not self.refused else self.message

    def count_bad_message(self, reason: Exception | str) -> None:
        """Count an invalid message."""
        self.bad_messages += 1
        self.metrics.record_problem(f"invalid message: {reason}")
