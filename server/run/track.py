"""``myview track``: one video, or just its detections, to MOTChallenge text."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np

from server.camera.ahead import ready_detector
from server.camera.sources import Image, Source, SourceEnded, open_source
from server.run.setup import config_for_videos
from server.wire.config import Config
from server.wire.errors import UserError
from server.wire.fit import Fit
from server.wire.loading import build_config, read_content
from server.wire.output import whole_file
from tracking import Detections, OnlineTracker, Solver, WindowResult, solver_named, solver_names
from tracking.detectors import MotFileDetector
from tracking.motchallenge import MotRow, write_rows

_NO_PICTURE = np.empty((0, 0, 3), dtype=np.uint8)


def track_one(
    video: Path | None,
    det: Path | None,
    out: Path,
    config: Path | None,
    solver: str | None,
    progress: Callable[[int], None],
) -> int:
    """Track and write; give the number of people.

    Raises:
        UserError: there is nothing to track in, or something cannot be read or written.
    """
    if video is None and det is None:
        raise UserError("track: name a video, or its detections with --det, or both")
    loaded = loaded_for(video, det, config)
    settings = loaded.track
    frames = _from_detections(det) if video is None and det is not None else _from_video(loaded)
    tracker = OnlineTracker(settings.window, settings.costs, solver_for(loaded, solver))
    rows: list[MotRow] = []
    with whole_file(out) as draft:
        for number, detections in frames:
            rows += final_rows(tracker.push(number, detections))
            progress(number + 1)
        rows += final_rows(tracker.flush())
        write_rows(draft, rows)
    return len({row.id for row in rows})


def solver_for(config: Config, name: str | None) -> Solver:
    """Give the solver of that name, or the configuration's.

    Raises:
        UserError: there is none.
    """
    if name is not None and name not in solver_names():
        raise UserError(f"--solver: no solver is called {name!r}; there are {', '.join(solver_names())}")
    return solver_named(name or config.track.solver)


def loaded_for(video: Path | None, det: Path | None, config: Path | None) -> Config:
    """Give the configuration, with the video as its only camera."""
    base = read_content(config) if config else {}
    base.pop("ground", None)  # one camera needs no floor; the file may be what `myview calibrate` is to make
    where, folder = str(config or "myview track"), config.parent if config else Path()
    if video is not None:
        return config_for_videos(
            [video], base=base, where=where, folder=folder, detections=[] if det is None else [det]
        )
    nothing = {"id": "detections", "source": "scene:none"}  # a configuration has a camera; nobody opens it
    return build_config({**base, "cameras": [nothing]}, where=where, folder=folder)


def _from_video(config: Config) -> Iterator[tuple[int, Detections]]:
    """Give the detections of every frame of the video in its own pixels."""
    camera = config.cameras[0]
    source = open_source(camera, config.site)
    fit = Fit(source.size, (config.site.width, config.site.height))
    detector = ready_detector(config, camera, source, fit)
    for number, image in pictures(source):
        if image is not None:
            found = detector.detect(fit.image(image), number)
            yield number, replace(found, boxes=fit.boxes_to_own(found.boxes))
    source.close()


def pictures(source: Source, first: int = 0) -> Iterator[tuple[int, Image | None]]:
    """Give the frames of a recording from `first` to its end; `None` where one has no picture."""
    for number in count(first):
        try:
            image = source.take(number)
        except SourceEnded:
            return
        yield number, image


def _from_detections(path: Path) -> Iterator[tuple[int, Detections]]:
    try:
        detector = MotFileDetector(path)
    except OSError as error:
        raise UserError(f"--det: {path}: {error.strerror}") from error
    except ValueError as error:
        raise UserError(f"--det: {error}") from error
    for number in range(detector.last + 1):
        yield number, detector.detect(_NO_PICTURE, number)


def final_rows(result: WindowResult | None) -> Iterator[MotRow]:
    """Give the rows of the frames that are final now, moments in hiding included."""
    if result is None:
        return
    for track in result.tracks:
        for number in range(result.first, result.final_to + 1):
            left, top, right, bottom = (float(side) for side in track.bridged[number - result.first])
            if not np.isnan(left):
                yield MotRow(number + 1, track.id, left, top, right - left, bottom - top)
