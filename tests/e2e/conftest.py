"""The recording that the end-to-end tests replay as if it were cameras."""

from __future__ import annotations

from pathlib import Path

import pytest

from fakes.page.browser import browser
from fakes.running.stream_frames import FPS
from synthetic import Scene, write_recording

__all__ = ["browser"]

SECONDS = 12.0


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three views of the synthetic room with four people in it."""
    folder = tmp_path_factory.mktemp("recording") / "room"
    write_recording(Scene("room", 3, 4, 1, 320, 180, FPS), folder, SECONDS)
    return folder
