"""What a recorded view says of its pictures: their size and rate."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from server.camera.sources import open_source
from server.camera.sources.opening import open_video
from server.run.setup import camera_name
from server.wire.errors import UserError
from server.wire.sections import Camera, Site

Size = tuple[int, int]
"""Width and height of a picture, pixels."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recorded view's pictures.

    Attributes:
        size: of each.
        fps: frames a second; None of a folder of images, which does not say.
    """

    size: Size
    fps: float | None


def look_at(view: Path) -> Recorded:
    """Look at a video or a folder of images.

    Raises:
        UserError: it cannot be opened.
    """
    if view.is_dir():
        source = open_source(Camera(id=camera_name(view), source=str(view.absolute())), Site())
        source.close()
        return Recorded(source.size, None)
    opened = open_video(str(view))
    opened.container.close()
    return Recorded(opened.size, opened.fps)


def parse_size(text: str) -> Size:
    """Read `WIDTHxHEIGHT`.

    Raises:
        UserError: it is not that.
    """
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise UserError(f"--size: {text!r} is not WIDTHxHEIGHT, such as 640x360")
    return int(width), int(height)
