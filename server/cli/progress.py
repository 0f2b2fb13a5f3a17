"""Progress bars of long commands."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from server.camera.sources.opening import open_video
from server.system.address_redaction import redact_to_host
from server.system.errors import UserError


def total_frames(videos: list[Path], fps: float | None = None) -> int | None:
    """Return the number of frames of all views, as stated by their files.

    ``fps`` is the rate at which frames are taken; None: that of each file.

    Returns:
        None: a file does not state its length.
    """
    total = 0
    for video in videos:
        if video.is_dir():
            return None
        if not video.exists():
            raise UserError(f"{redact_to_host(str(video))}: no such file or folder")
        opened = open_video(str(video))
        opened.container.close()
        if not opened.frames:
            return None
        total += opened.frames if fps is None else round(opened.frames * fps / opened.fps)
    return total


def bar(unit: str) -> Progress:
    """Return a progress bar on standard error, disabled if that is not a terminal."""
    console = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn(unit),
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,  # a log needs only the result
    )
