"""Public detections with ground truth, and MyView's tracks of them."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from benchmarks.common.environment import CannotRunError
from server.cli.track.command import track_one
from tracking.evaluation import Scores, evaluate
from tracking.motchallenge import MotRow, read_rows

TrackSettings = Mapping[str, Mapping[str, Any]]
"""Keys of the configuration section `track` that differ from the defaults."""


@dataclass(frozen=True, slots=True)
class Recording:
    """One camera's detections and ground truth."""

    name: str
    detections: Path
    truth: Path
    video: Path | None = None

    def score(self, tracks: list[MotRow]) -> Scores:
        """Score tracks of this recording."""
        return evaluate(read_rows(self.truth), tracks)


def find_recordings(data: Path, names: list[str] | None = None) -> list[Recording]:
    """Return the recordings in the data folder, or those named.

    Raises:
        CannotRunError: there are none.
    """
    campus, pets, auditorium = data / "mot15" / "TUD-Campus", data / "pets09", data / "auditorium"
    candidates = [
        Recording("TUD-Campus", campus / "det.txt", campus / "gt.txt"),
        Recording("pets09", pets / "det" / "view1.txt", pets / "gt" / "view1.txt", pets / "view1.mp4"),
        *(
            Recording(camera, auditorium / "det" / f"{camera}.txt.gz", auditorium / "gt" / f"{camera}.txt.gz")
            for camera in ("HC3", "HC4", "IP2", "IP5")
        ),
    ]
    found = [
        recording for recording in candidates if recording.detections.is_file() and recording.truth.is_file()
    ]
    if names:
        found = [recording for recording in found if recording.name in names]
    if not found:
        missing = ", ".join(names or [recording.name for recording in candidates])
        raise CannotRunError(f"needs detections and ground truth ({missing}) in {data}")
    return found


def track(
    recording: Recording, settings: TrackSettings | None = None, *, pictures: bool = False
) -> list[MotRow]:
    """Return MyView's tracks, as `myview track --det` writes them.

    With `pictures`, appearance is computed from the video; without, tracking uses boxes and confidences only.
    """
    with tempfile.TemporaryDirectory() as folder:
        out, config = Path(folder) / "tracks.txt", Path(folder) / "settings.yaml"
        config.write_text(
            yaml.safe_dump({"track": {key: dict(section) for key, section in (settings or {}).items()}}),
            encoding="utf-8",
        )
        video = recording.video if pictures else None
        track_one(video, recording.detections, out, config, None, lambda _: None)
        return read_rows(out)
