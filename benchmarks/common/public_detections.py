"""Public detections with ground truth, and MyView's tracks of them."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from benchmarks.common.environment import CannotRunError
from server.cli.track.command import config_for_video, detect_frames, newly_final_rows
from server.config.site_config import Config
from tracking import Detections, OnlineTracker
from tracking.detectors import MotFileDetector
from tracking.evaluation import Scores, evaluate
from tracking.motchallenge import MotRow, read_rows

_NO_PICTURE = np.empty((0, 0, 3), dtype=np.uint8)

TrackSettings = Mapping[str, Mapping[str, Any]]
"""Keys of the configuration section `track` that differ from the defaults."""


@dataclass(frozen=True, slots=True)
class Recording:
    """One camera's detections and ground truth.

    Attributes:
        detections: public ones; None: those of MyView's own detector in the video.
        fps: frames per second, at which it was recorded; a video's file can say otherwise.
    """

    name: str
    detections: Path | None
    truth: Path
    fps: float
    video: Path | None = None

    @property
    def public_detections(self) -> Path:
        """The file of its public detections.

        Raises:
            ValueError: it has none.
        """
        if self.detections is None:
            raise ValueError(f"{self.name} has no public detections")
        return self.detections

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
        Recording("TUD-Campus", campus / "det.txt", campus / "gt.txt", 25.0),
        Recording("pets09", pets / "det" / "view1.txt", pets / "gt" / "view1.txt", 7.0, pets / "view1.mp4"),
        *(
            Recording(name, auditorium / "det" / f"{name}.txt.gz", auditorium / "gt" / f"{name}.txt.gz", 30.0)
            for name in ("HC3", "HC4", "IP2", "IP5")
        ),
    ]
    found = [
        recording
        for recording in candidates
        if recording.detections and recording.detections.is_file() and recording.truth.is_file()
    ]
    if names:
        found = [recording for recording in found if recording.name in names]
    if not found:
        missing = ", ".join(names or [recording.name for recording in candidates])
        raise CannotRunError(f"needs detections and ground truth ({missing}) in {data}")
    return found


def find_development_recordings(data: Path) -> list[Recording]:
    """Return recordings for choosing settings, which no result is reported on.

    Raises:
        CannotRunError: there are none.
    """
    views = [(folder, view) for folder in ("terrace", "terrace2") for view in ("c0", "c1")]
    found = [
        Recording(f"{folder} {view}", None, data / folder / "gt" / f"{view}.txt", 25.0, video)
        for folder, view in views
        if (video := data / folder / f"{view}.mp4").is_file()
    ]
    if not found:
        raise CannotRunError(f"needs terrace in {data}; --data or MYVIEW_TEST_DATA give the folder")
    return found


def configured(
    recording: Recording, settings: TrackSettings | None = None, *, pictures: bool = False
) -> Config:
    """Return the configuration that `myview track --det` uses, with other settings of the section `track`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "settings.yaml"
        path.write_text(
            yaml.safe_dump({"track": {key: dict(section) for key, section in (settings or {}).items()}}),
            encoding="utf-8",
        )
        return config_for_video(recording.video if pictures else None, recording.detections, path)


def detections(recording: Recording, config: Config, *, pictures: bool = False) -> Iterator[Detections]:
    """Yield the detections of all frames, with the histograms of its pictures or without."""
    if pictures or recording.detections is None:
        yield from (frame.detections for frame in detect_frames(config))
        return
    detector = MotFileDetector(recording.public_detections)
    for number in range(detector.last_frame + 1):
        yield detector.detect(_NO_PICTURE, number)


def track(
    recording: Recording, settings: TrackSettings | None = None, *, pictures: bool = False
) -> list[MotRow]:
    """Return MyView's tracks, as `myview track --det` writes them at the recording's true frame rate.

    With `pictures`, appearance is computed from the video; without, tracking uses boxes and confidences only.
    """
    config = configured(recording, settings, pictures=pictures)
    solver = config.track.create_solver(recording.fps)
    center = (config.site.width / 2.0, config.site.height / 2.0) if pictures else None
    tracker = OnlineTracker(config.track.window, config.track.costs, solver, recording.fps, center)
    rows: list[MotRow] = []
    for number, seen in enumerate(detections(recording, config, pictures=pictures)):
        rows += newly_final_rows(tracker.push(number, seen))
    rows += newly_final_rows(tracker.flush())
    return sorted(rows, key=lambda row: (row.frame, row.id))
