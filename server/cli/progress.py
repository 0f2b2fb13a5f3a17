"""Progress bars for what takes a while."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from server.camera.sources.opening import open_video
from server.system.address_redaction import redact_address
from server.system.errors import UserError


def total_frames(videos: list[Path], fps: float | None = None) -> int | None:
    """Count the frames of all views as their files say it; None where one does not.

    ``fps``: how many are taken a second; None: as many as there are.
    """
    total = 0
    for video in videos:
        if video.is_dir():
            return None
        if not video.exists():
            raise UserError(f"{redact_address(str(video))}: no such file or folder")
        opened = open_video(str(video))
        opened.container.close()
        if not opened.frames:
            return None
        total += opened.frames if fps is None else round(opened.frames * fps / opened.fps)
    return total


def bar(unit: str) -> Progress:
    """Return a progress bar on standard error, where that is a terminal."""
    console = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,  # in a log it would only stand around the one line that matters
    )
