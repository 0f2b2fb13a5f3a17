"""Operator assistance: flags for predicted tracking failures, and position corrections."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from server.messaging.operator_messages import CORRECTIONS_MAX, TOLERANCE_MIN
from server.service.facade.errors import (
    ConflictError,
    InvalidCommandError,
    UnknownCameraError,
    UnknownObjectError,
)
from server.service.operator_assist.flags import Flag
from server.service.operator_assist.operator_assist import MarkedPosition
from server.service.pipeline import BestViewPipeline

__all__ = [
    "CORRECTIONS_MAX",
    "AssistService",
    "CorrectPositions",
    "CorrectionResult",
    "Flag",
    "OperatorPosition",
]

_DEFAULT_TOLERANCE = 0.02
"""The default tolerance of a position, as a share of the image width."""
_MAX_TOLERANCE = 0.5


@dataclass(frozen=True, slots=True)
class OperatorPosition:
    """A position in a frame, in pixels of the site's image."""

    pulse: int
    x: float
    y: float
    tolerance: float | None
    """Tolerance in pixels; None: a fiftieth of the image width."""


@dataclass(frozen=True, slots=True)
class CorrectPositions:
    """Command: a person is at these positions in a camera's image."""

    number: int
    camera: str
    positions: Sequence[OperatorPosition]


@dataclass(frozen=True, slots=True)
class CorrectionResult:
    """The result of a :class:`CorrectPositions`."""

    accepted: int
    """The number of positions that were sent to the camera's tracker."""
    flags: list[int]
    """The flags that these corrections respond to."""


class AssistService:
    """Queries and commands of operator assistance."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._pipeline, self._flags = pipeline, pipeline.assist.flags

    @property
    def open_flags(self) -> list[Flag]:
        """Flags that can be answered, the most urgent first."""
        return self._flags.open

    @property
    def ended_flags(self) -> list[Flag]:
        """Flags that were answered or have expired, the newest first."""
        return self._flags.ended

    def subscribe_flags(self, callback: Callable[[Flag], None]) -> None:
        """Call back with every flag that is raised or changes."""
        self._flags.on_flag.append(callback)

    @property
    def memory_frames(self) -> int:
        """How many frames back a position can be corrected."""
        config = self._pipeline.config
        return config.track.assist.resolve(config.site.fps).memory_frames

    @property
    def why_unavailable(self) -> str:
        """Why positions cannot be corrected here; empty: they can."""
        config = self._pipeline.config
        if config.view.sharding.editing_blocked:
            return config.view.sharding.editing_blocked
        if not config.track.assist.enabled:
            return "cameras accept no corrections: track.assist.enabled is off"
        return ""

    def correct_positions(self, command: CorrectPositions) -> CorrectionResult:
        """Send a person's positions to a camera's tracker, which corrects its tracks, also past ones.

        Raises:
            ConflictError: positions cannot be corrected here, or the camera did not show the person then.
            UnknownCameraError: there is no such camera.
            UnknownObjectError: no person has this number.
            InvalidCommandError: a position is outside the image, or its frame is in the future.
        """
        pipeline, camera = self._pipeline, command.camera
        if self.why_unavailable:
            raise ConflictError(self.why_unavailable)
        if camera not in pipeline.frame_buffers:
            raise UnknownCameraError(camera, pipeline.frame_buffers)
        number = pipeline.decider.people.registry.current(command.number)
        if number not in pipeline.decider.people.known:
            is_recovering = pipeline.state_replication.is_known_or_recoverable(command.number)
            raise UnknownObjectError(command.number, is_recovering=is_recovering)
        for position in command.positions:
            self._check(position)
        positions = [self._marked(position) for position in command.positions]
        accepted, flags = pipeline.assist.correct(number, camera, positions)
        if not accepted:
            raise ConflictError(f"camera {camera} did not show object {number} then, or the frame is too old")
        return CorrectionResult(accepted, flags)

    def _check(self, position: OperatorPosition) -> None:
        site = self._pipeline.config.site
        if not (0 <= position.x <= site.width and 0 <= position.y <= site.height):
            place = f"{position.x:g}, {position.y:g}"
            raise InvalidCommandError(
                f"corrections: {place} is not in a picture of {site.width}x{site.height}"
            )
        if position.pulse > self._pipeline.pulses.newest:
            raise InvalidCommandError(f"corrections: pulse {position.pulse} is in the future")

    def _marked(self, position: OperatorPosition) -> MarkedPosition:
        width = self._pipeline.config.site.width
        if position.tolerance is None:
            tolerance = _DEFAULT_TOLERANCE * width
        else:
            tolerance = min(position.tolerance, _MAX_TOLERANCE * width)
        return MarkedPosition(position.pulse, position.x, position.y, max(tolerance, TOLERANCE_MIN))
