"""The recording that the end-to-end tests replay as if it were cameras, and a site that several share."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from beeps import write_beeps
from running_site import RunningSite, configuration, running
from spliced import FPS

from server.camera.scene import Scene, write_recording

SECONDS = 20.0


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three views of the synthetic room with four people in it."""
    folder = tmp_path_factory.mktemp("recording") / "room"
    write_recording(Scene("room", 3, 4, 1, 320, 180, FPS), folder, SECONDS)
    return folder


@pytest_asyncio.fixture(scope="session", loop_scope="session")
async def site(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[RunningSite]:
    """A site with sound whose recordings begin again at their end, with people in sight.

    All tests of the files in ``ON_ONE_SITE`` share it, also those that kill a process of it: it comes back.
    """
    folder = tmp_path_factory.mktemp("site")
    sound = {"source": str(write_beeps(folder / "beeps.wav")), "at_end": "loop"}
    config = configuration(folder, recording, camera={"at_end": "loop"}, sound=sound)
    async with running(config) as site:
        await site.until(lambda: bool(site.gops and site.gops[-1].choices), "somebody is shown")
        yield site
