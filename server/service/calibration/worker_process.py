"""Calibrating beside the service: it takes seconds, in which streams must go on."""

from __future__ import annotations

import contextlib
import logging

import msgspec

from server.service.calibration.worker_messages import Done, Task
from server.system.child_process import start_child

log = logging.getLogger(__name__)


async def calibrated(task: Task) -> Done:
    """Let a process of its own calibrate from a walk; it is ended where nobody waits for it any more."""
    try:
        process = await start_child("server.service.calibration")
    except OSError as error:
        return Done(error=f"the calibration cannot be started: {error.strerror}")
    try:
        said, _ = await process.communicate(msgspec.msgpack.encode(task))
        return msgspec.msgpack.decode(said, type=Done)
    except msgspec.DecodeError:
        log.error("the process that calibrates ended with status %s", process.returncode)  # noqa: TRY400
        return Done(error="the calibration went wrong; the server's log says more")
    finally:
        if process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
