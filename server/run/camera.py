"""One camera's process."""

from __future__ import annotations

import asyncio

from camsync import SyncError
from server.camera.process import CameraProcess
from server.wire.config import Config
from server.wire.errors import AwayError


async def camera_process(config: Config, camera_id: str) -> None:
    """Run one camera.

    Raises:
        UserError: its source cannot be opened.
        AwayError: it lost the pulses for good.
    """
    camera = await asyncio.to_thread(CameraProcess, config, camera_id)
    try:
        await camera.run()
    except SyncError as error:
        raise AwayError(f"camera {camera_id}: {error}") from error
