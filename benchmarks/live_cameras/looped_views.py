"""Four looped cameras (CIF, 25 frames a second): recordings of crowds, or the synthetic room."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.common.environment import CannotRunError
from benchmarks.common.recorded_views import ROOM, RecordedViews, find_views
from benchmarks.paper_experiments.scene import HEIGHT, WIDTH
from synthetic import Scene, write_recording

CROWD = "crowd"
FPS = 25.0
CAMERAS = 4
_SCENES = ("terrace", "campus4")
_ROOM_PEOPLE, _ROOM_SEED, _ROOM_S = 5, 1, 60.0


@dataclass(frozen=True, slots=True)
class LoopedViews:
    """Cameras that play their recordings in a loop."""

    name: str
    views: tuple[RecordedViews, ...]

    @property
    def ground(self) -> Path | None:
        """The file of homographies, where all cameras are of one scene."""
        return self.views[0].ground if len(self.views) == 1 else None

    @property
    def cameras(self) -> list[dict[str, Any]]:
        """The section `cameras` of the configuration."""
        found = [camera for views in self.views for camera in views.cameras][:CAMERAS]
        names = [f"c{number}" for number in range(len(found))]
        return [{**one, "id": name, "at_end": "loop"} for name, one in zip(names, found, strict=True)]

    @property
    def site(self) -> dict[str, Any]:
        """The section `site` of the configuration."""
        return {"name": "bench", "fps": FPS, "width": WIDTH, "height": HEIGHT}


def live_views(name: str, data: Path, folder: Path) -> LoopedViews:
    """Return the cameras of that name; the synthetic room is first rendered into the folder.

    Raises:
        CannotRunError: the recordings are missing.
    """
    if name == ROOM:
        scene = Scene(ROOM, CAMERAS, _ROOM_PEOPLE, _ROOM_SEED, WIDTH, HEIGHT, FPS)
        write_recording(scene, folder / ROOM, _ROOM_S, lambda _done, _total: None)
        return LoopedViews(name, (find_views(folder, ROOM),))
    return LoopedViews(name, tuple(find_views(data, scene) for scene in _SCENES))


def usual_views(data: Path) -> str:
    """Return the name of the recordings if they are available, else that of the synthetic room."""
    try:
        for scene in _SCENES:
            find_views(data, scene)
    except CannotRunError:
        return ROOM
    return CROWD
