"""Picture size and frame rate of a recorded view."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from server.camera.sources import ImageFolder, Recording
from server.system.errors import UserError

Size = tuple[int, int]
"""Width and height of a picture, pixels."""


@dataclass(frozen=True, slots=True)
class VideoInfo:
    """Properties of a recorded view.

    Attributes:
        size: width and height as shown: upright, with square pixels.
        fps: frames per second; None: unknown, since it is a folder of images.
    """

    size: Size
    fps: float | None


def read_video_info(view: Path) -> VideoInfo:
    """Read the picture size and frame rate of a video or a folder of images.

    Raises:
        UserError: it cannot be opened, or has no picture.
    """
    if view.is_dir():
        return VideoInfo(ImageFolder(str(view), 0, "stop").size, None)
    recording = Recording(str(view), quiet=True)
    recording.close()
    return VideoInfo(recording.size, recording.fps)


def parse_size(text: str) -> Size:
    """Parse `WIDTHxHEIGHT`.

    Raises:
        UserError: the text is not a size.
    """
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise UserError(f"--size: {text!r} is not WIDTHxHEIGHT, such as 640x360")
    return int(width), int(height)
