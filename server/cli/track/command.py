"""``myview track``: tracks people in a video or in detections, and writes MOTChallenge text."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np

from server.camera.detector_setup import make_prescanned_detector
from server.camera.sources import FrameSource, Image, SourceEndedError, open_source
from server.camera.tracker_setup import set_up_tracker
from server.cli.generated_config import config_for_videos
from server.config.loader import build_config, read_content
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from server.system.atomic_write import atomic_file
from server.system.errors import UserError, reason_of
from tracking import Detections, Solver, WindowResult, solver_names
from tracking.detectors import MotFileDetector
from tracking.motchallenge import MotRow, write_rows
from tracking.registry import Tracker, needs_images, tracker_names

_NO_PICTURE = np.empty((0, 0, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class RecordedFrame:
    """A frame of a recording, counted from 0; without an image if only detections are given."""

    number: int
    detections: Detections
    image: Image | None


def track_one(
    video: Path | None,
    det: Path | None,
    out: Path,
    config: Path | None,
    solver: str | None,
    progress: Callable[[int], None],
    tracker: str | None = None,
) -> int:
    """Track people and write their tracks; return the number of people.

    Raises:
        UserError: neither video nor detections are given, a file cannot be read or written, or the solver or
            tracker is unknown.
    """
    if video is None and det is None:
        raise UserError("track: name a video, or its detections with --det, or both")
    loaded = config_for_video(video, det, config)
    frames = _from_detections(det) if video is None and det is not None else detect_frames(loaded)
    name = _tracker_for(loaded, tracker, video)
    person_tracker = _set_up(loaded, name, lambda: solver_for(loaded, solver), has_pictures=video is not None)
    rows: list[MotRow] = []
    with atomic_file(out, video, det) as draft:
        for frame in frames:
            rows += newly_final_rows(person_tracker.push(frame.number, frame.detections, frame.image))
            progress(frame.number + 1)
        rows += newly_final_rows(person_tracker.flush())
        write_rows(draft, rows)
    return len({row.id for row in rows})


def _tracker_for(config: Config, name: str | None, video: Path | None) -> str:
    """Return the tracker of this name, by default the configured one.

    Raises:
        UserError: it is unknown, or needs pictures without a video.
    """
    if name is not None and name not in tracker_names():
        raise UserError(f"--tracker: there is no tracker {name!r}; there are {', '.join(tracker_names())}")
    chosen = name or config.track.tracker
    if video is None and needs_images(chosen):
        raise UserError(f"--tracker: {chosen} needs pictures: give a video, too")
    return chosen


def _set_up(config: Config, name: str, solver: Callable[[], Solver], *, has_pictures: bool) -> Tracker:
    """Return the tracker, set up for the video's size, and warmed up on it if it needs pictures."""
    camera = config.cameras[0]
    if not has_pictures:
        return set_up_tracker(config, name, camera, None, solver)
    with closing(open_source(camera, config.site)) as source:
        return set_up_tracker(config, name, camera, source, solver)


def solver_for(config: Config, name: str | None) -> Solver:
    """Return the solver of this name, by default the configured one.

    Raises:
        UserError: it is unknown.
    """
    if name is not None and name not in solver_names():
        raise UserError(f"--solver: there is no solver {name!r}; there are {', '.join(solver_names())}")
    return config.track.create_solver(config.site.fps, name)


def config_for_video(video: Path | None, det: Path | None, config: Path | None) -> Config:
    """Return the configuration with the video as its only camera."""
    base = read_content(config) if config else {}
    base.pop("ground", None)  # not needed for one camera, and may not exist yet
    where, folder = str(config or "myview track"), config.parent if config else Path()
    if video is not None:
        return config_for_videos(
            [video], base=base, where=where, folder=folder, detections=[] if det is None else [det]
        )
    placeholder = {"id": "detections", "source": "scene:none"}  # required, but never opened
    return build_config({**base, "cameras": [placeholder]}, where=where, folder=folder)


def detect_frames(config: Config) -> Iterator[RecordedFrame]:
    """Yield every frame of the video with its detections, in pixels of the video."""
    camera = config.cameras[0]
    source = open_source(camera, config.site)
    letterbox = Letterbox(source.size, (config.site.width, config.site.height))
    detector = make_prescanned_detector(config, camera, source, letterbox)
    for number, image in read_frames(source):
        if image is not None:
            detections = detector.detect(letterbox.image(image), number)
            yield RecordedFrame(
                number, replace(detections, boxes=letterbox.boxes_site_to_camera(detections.boxes)), image
            )
    source.close()


def read_frames(source: FrameSource, first: int = 0) -> Iterator[tuple[int, Image | None]]:
    """Yield the frames of a recording from ``first`` to its end; None: a frame without a picture."""
    for number in count(first):
        try:
            image = source.take(number)
        except SourceEndedError:
            return
        yield number, image


def _from_detections(path: Path) -> Iterator[RecordedFrame]:
    try:
        detector = MotFileDetector(path)
    except OSError as error:
        raise UserError(f"--det: {path}: {reason_of(error)}") from error
    except ValueError as error:
        raise UserError(f"--det: {error}") from error
    for number in range(detector.last_frame + 1):
        yield RecordedFrame(number, detector.detect(_NO_PICTURE, number), None)


def newly_final_rows(result: WindowResult | None) -> Iterator[MotRow]:
    """Yield the rows of newly final frames, including interpolated ones."""
    if result is None:
        return
    for track in result.tracks:
        for number in range(result.first, result.final_to + 1):
            box = track.interpolated[number - result.first].tolist()
            if not np.isnan(box[0]):
                yield MotRow.of_box(number + 1, track.id, box)
