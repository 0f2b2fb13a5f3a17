"""Messages to and from the calibration process, MessagePack, and the function that runs it."""

from __future__ import annotations

import logging

import msgspec

from server.system.errors import reason_of
from server.system.worker.process import WorkerDiedError
from server.system.worker.single_request import ask_new_worker


class CameraBoxes(msgspec.Struct, frozen=True, array_like=True):
    """One camera's R boxes of a walk. Arrays are sent as raw bytes: they are long."""

    camera: str
    size: tuple[int, int]
    """Width and height of its image, pixels."""
    frames: bytes
    """(R,) int64 from 0."""
    track: bytes
    """(R,) int64, the index of the track."""
    boxes: bytes
    """(R, 4) float64, left, top, right, bottom in pixels of that image."""


class CalibrationTask(msgspec.Struct, frozen=True):
    """A walk to calibrate from."""

    cameras: list[CameraBoxes]
    fps: float
    max_offset_s: float
    """The largest time offset between cameras, in seconds."""
    person_height: float
    """In meters."""
    offsets: dict[str, int]
    """By camera, the offset that the configuration applies already; only cameras that can have one."""


class CalibrationResult(msgspec.Struct, frozen=True):
    """The result of a calibration."""

    error: str = ""
    """Why the calibration failed; empty: it succeeded."""
    lines: list[str] = []
    """The report."""
    insufficient: str = ""
    """What the walk did not cover, if the result is only a guess because of that; else empty."""
    offsets: str = ""
    """Configuration lines that synchronize the cameras; empty: they are synchronized."""
    ground: str = ""
    """The text of the ground file."""
    plan: bytes = b""
    """The floor plan, PNG."""


log = logging.getLogger(__name__)


async def run_calibration(task: CalibrationTask) -> CalibrationResult:
    """Calibrate from a walk in a separate process, which is killed if the caller is cancelled."""
    try:
        return await ask_new_worker("server.service.calibration", task, CalibrationResult)
    except OSError as error:
        return CalibrationResult(error=f"the calibration cannot be started: {reason_of(error)}")
    except WorkerDiedError as error:
        log.error("the calibration process %s", error)  # noqa: TRY400
        return CalibrationResult(error="the calibration failed; see the server's log")
