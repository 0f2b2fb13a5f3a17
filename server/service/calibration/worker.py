"""What the service tells the process that calibrates, and what that answers: a message each, MessagePack."""

from __future__ import annotations

import contextlib
import logging

import msgspec

from server.system.child_process import start_worker


class CameraBoxes(msgspec.Struct, frozen=True, array_like=True):
    """What one camera saw of a walk: R boxes. Arrays as they lie in memory: they are long."""

    camera: str
    size: tuple[int, int]
    """Width and height of its own picture, pixels."""
    frames: bytes
    """(R,) int64 from 0."""
    who: bytes
    """(R,) int64, whose track each is."""
    boxes: bytes
    """(R, 4) float64, left, top, right, bottom in pixels of that picture."""


class CalibrationTask(msgspec.Struct, frozen=True):
    """A walk to calibrate from."""

    seen: list[CameraBoxes]
    fps: float
    shift: float
    """Largest time offset between cameras, seconds."""
    person: float
    """People's height, meters."""
    offsets: dict[str, int]
    """By camera: what the frames have in them already; of those that it can be set of."""


class CalibrationResult(msgspec.Struct, frozen=True):
    """What has come of it."""

    error: str = ""
    """Why nothing has; empty: something has."""
    lines: list[str] = []
    too_little: str = ""
    """What the walk did not cover, where the result is a guess for want of that."""
    offsets: str = ""
    """Lines of a configuration that bring the cameras into step; empty: they are."""
    ground: str = ""
    """The text of the ground file."""
    plan: bytes = b""
    """The floor plan, PNG."""


log = logging.getLogger(__name__)


async def run_calibration(task: CalibrationTask) -> CalibrationResult:
    """Let a process of its own calibrate from a walk; it is ended where nobody waits for it any more."""
    try:
        process = await start_worker("server.service.calibration")
    except OSError as error:
        return CalibrationResult(error=f"the calibration cannot be started: {error.strerror}")
    try:
        said, _ = await process.communicate(msgspec.msgpack.encode(task))
        return msgspec.msgpack.decode(said, type=CalibrationResult)
    except msgspec.DecodeError:
        log.error("the process that calibrates ended with status %s", process.returncode)  # noqa: TRY400
        return CalibrationResult(error="the calibration went wrong; the server's log says more")
    finally:
        if process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
