"""Recorded views: real ones from the data folder, or renderings of the synthetic room."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.common.environment import CannotRunError
from server.camera.sources.opening import open_video
from server.cli.render.video_info import read_video_info
from synthetic import Scene, write_recording
from tracking.motchallenge import MotRow, read_rows

ROOM = "room"
_ROOM_CAMERAS, _ROOM_PEOPLE, _ROOM_SEED = 3, 4, 1
_ROOM_WIDTH, _ROOM_HEIGHT, _ROOM_FPS = 640, 360, 25.0

_WATERMARK = [[130, 232], [355, 232], [355, 283], [130, 283]]
"""The polygon of a translucent watermark, which hides the background."""
_WATERMARKED = ("campus4", "terrace", "terrace2")


@dataclass(frozen=True, slots=True)
class RecordedViews:
    """Frame-synchronous recordings of one scene."""

    name: str
    videos: tuple[Path, ...]
    ground: Path | None
    """The file of homographies to the ground plane."""

    @property
    def cameras(self) -> list[dict[str, Any]]:
        """The section `cameras` of the configuration."""
        ignore = {"ignore": [_WATERMARK]} if self.name in _WATERMARKED else {}
        return [{"id": video.stem, "source": str(video.absolute()), **ignore} for video in self.videos]

    @property
    def site(self) -> dict[str, Any]:
        """The section `site` of the configuration, with frame rate and size of the first view."""
        first = read_video_info(self.videos[0])
        return {"name": "bench", "fps": first.fps, "width": first.size[0], "height": first.size[1]}

    @property
    def content(self) -> dict[str, Any]:
        """The configuration."""
        ground = {} if self.ground is None else {"ground": str(self.ground.absolute())}
        return {"site": self.site, "cameras": self.cameras, **ground}

    @property
    def truth(self) -> dict[str, list[MotRow]]:
        """The ground truth of each view that has some."""
        files = {video.stem: video.parent / "gt" / f"{video.stem}.txt" for video in self.videos}
        return {name: read_rows(file) for name, file in files.items() if file.exists()}

    @property
    def frames(self) -> int:
        """The total number of frames of all views, by their metadata."""
        total = 0
        for video in self.videos:
            opened = open_video(str(video))
            opened.container.close()
            total += opened.frames
        return total


def find_views(data: Path, name: str) -> RecordedViews:
    """Find a scene's views in the data folder.

    Raises:
        CannotRunError: they are missing.
    """
    folder = data / name
    videos = tuple(sorted(folder.glob("*.mp4")))
    if not videos:
        raise CannotRunError(
            f"needs the recordings {folder}/*.mp4; --data or MYVIEW_TEST_DATA give the folder"
        )
    ground = folder / "ground.json"
    return RecordedViews(name, videos, ground if ground.exists() else None)


def find_or_draw(name: str, data: Path, folder: Path, seconds: float) -> RecordedViews:
    """Find a scene's views in the data folder; the room is rendered into a new folder inside ``folder``.

    Raises:
        CannotRunError: they are missing.
    """
    return draw_room(folder / ROOM, seconds) if name == ROOM else find_views(data, name)


def draw_room(folder: Path, seconds: float) -> RecordedViews:
    """Render the demo's scene into a new folder."""
    size = (_ROOM_WIDTH, _ROOM_HEIGHT, _ROOM_FPS)
    scene = Scene(ROOM, _ROOM_CAMERAS, _ROOM_PEOPLE, _ROOM_SEED, *size)
    write_recording(scene, folder, seconds, lambda _done, _total: None)
    return find_views(folder.parent, folder.name)
