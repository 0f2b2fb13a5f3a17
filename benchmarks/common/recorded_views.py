"""Recorded views to measure with: real ones from the data folder, or the embedded scene drawn on the spot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.common.environment import CannotRunError
from server.camera.sources.opening import open_video
from server.cli.render.video_info import read_video_info
from synthetic import Scene, write_recording

ROOM = "room"
_ROOM_CAMERAS, _ROOM_PEOPLE, _ROOM_SEED = 3, 4, 1
_ROOM_WIDTH, _ROOM_HEIGHT, _ROOM_FPS = 640, 360, 25.0

_WATERMARK = [[130, 232], [355, 232], [355, 283], [130, 283]]
"""Half-transparent and in every frame: where it lies nobody can be told from the background."""
_WATERMARKED = ("campus4", "terrace")


@dataclass(frozen=True, slots=True)
class RecordedViews:
    """Views of one scene, frame-synchronous."""

    name: str
    videos: tuple[Path, ...]
    ground: Path | None
    """Homographies to the ground plane."""

    @property
    def cameras(self) -> list[dict[str, Any]]:
        """The configuration's cameras."""
        ignore = {"ignore": [_WATERMARK]} if self.name in _WATERMARKED else {}
        return [{"id": it.stem, "source": str(it.absolute()), **ignore} for it in self.videos]

    @property
    def site(self) -> dict[str, Any]:
        """The configuration's site: rate and size of the first view."""
        first = read_video_info(self.videos[0])
        return {"name": "bench", "fps": first.fps, "width": first.size[0], "height": first.size[1]}

    @property
    def frames(self) -> int:
        """How many pictures the views have, all together, as their files say it."""
        total = 0
        for video in self.videos:
            opened = open_video(str(video))
            opened.container.close()
            total += opened.frames
        return total


def find_views(data: Path, name: str) -> RecordedViews:
    """Find a scene's views in the folder of recordings.

    Raises:
        CannotRunError: they are not there.
    """
    folder = data / name
    videos = tuple(sorted(folder.glob("c*.mp4")))
    if not videos:
        raise CannotRunError(f"needs the recordings {folder}/c*.mp4; --data or MYVIEW_TEST_DATA say where")
    ground = folder / "ground.json"
    return RecordedViews(name, videos, ground if ground.exists() else None)


def draw_room(folder: Path, seconds: float) -> RecordedViews:
    """Record the demo's scene into a new folder."""
    size = (_ROOM_WIDTH, _ROOM_HEIGHT, _ROOM_FPS)
    scene = Scene(ROOM, _ROOM_CAMERAS, _ROOM_PEOPLE, _ROOM_SEED, *size)
    write_recording(scene, folder, seconds, lambda _done, _total: None)
    return find_views(folder.parent, folder.name)
