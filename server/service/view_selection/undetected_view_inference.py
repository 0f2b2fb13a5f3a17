"""Infers views of people whom a camera does not detect though other cameras locate them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestview import (
    DetectionProbabilityMap,
    boxes_touching_others,
    estimate_bodies,
    project_boxes,
    project_feet,
)
from bestview.quality import CameraLayout, QualitySettings, TrackWindow, compute_view_quality
from server.config.site_config import Config
from server.service.view_selection.undetected_views import TestedViews, UndetectedViews
from server.service.view_selection.view_quality_buffer import ViewQualityBuffer
from server.service.view_selection.window_tracks import WindowTracks

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_INTERVAL_S = 0.4
"""Seconds between inferences: missed detections last longer."""
_PRIOR, _FEW_S, _MANY_S = 0.93, 1.5, 4.0
"""Prior detection probability; seconds of observed people after which places, and cameras, are known."""
_MEMORY_S = 600.0
"""Time constant of forgetting, in seconds: furniture is moved."""
_NO_BOX_FACTOR = 0.4
"""Factor on the quality where the camera has no box at all: not even part of the person seems visible."""
_MIN_VIEW_PROBABILITY = 0.25
"""Least probability that the camera shows the person: below it no view is inferred."""


class UndetectedViewInference:
    """Infers views of people whom a camera does not detect, and learns each camera's detection probability.

    It uses the cameras' messages alone, and all people of all shards, so that all services of a site agree.
    """

    def __init__(self, config: Config, quality_buffer: ViewQualityBuffer) -> None:
        self._quality_buffer, self._cameras = quality_buffer, config.camera_ids
        self._fps = config.site.fps
        self._interval = max(1, round(_INTERVAL_S * self._fps))
        self._size = (float(config.site.width), float(config.site.height))
        few, many = _FEW_S * self._fps, _MANY_S * self._fps
        self._detection_probability = DetectionProbabilityMap(
            len(self._cameras), self._size, _PRIOR, few, many
        )

    def infer(self, tracks: WindowTracks, person: Ints, frames: int) -> UndetectedViews:
        """Infer views in a window's frames; `person` (L,) is the person of each box, -1: unknown."""
        floor = self._floor()
        if len(floor.cameras) < 2:  # noqa: PLR2004 — one that detects, one that does not
            return UndetectedViews.empty()
        samples = _detection_samples(
            tracks, person, floor.cameras, len(self._cameras), self._interval, frames
        )
        if not len(samples.people):
            return UndetectedViews.empty()
        known, shape = samples.person >= 0, samples.detected.shape
        moment = samples.person[known] * shape[1] + samples.time[known]
        bottom = floor.layout.picture_boxes[:, 3]
        body = estimate_bodies(
            samples.boxes[known],
            samples.camera[known],
            moment,
            shape[0] * shape[1],
            floor.homographies,
            bottom,
        )
        feet = project_feet(body, floor.homographies).reshape(*shape, 2)
        corners = floor.layout.picture_boxes
        inside = ((feet >= corners[:, :2]) & (feet <= corners[:, 2:])).all(axis=-1)
        others = body.known_by.sum(axis=1)[:, None] > body.known_by
        tests = np.nonzero(inside & samples.can_detect & others.reshape(shape))
        tested = TestedViews(
            tests[1] * self._interval, floor.cameras[tests[2]], feet[tests], samples.detected[tests]
        )
        view = np.nonzero(inside & ~samples.detected)
        probability = self._detection_probability.undetected_view_probability(
            floor.cameras[view[2]], feet[view]
        )
        is_probable = probability >= _MIN_VIEW_PROBABILITY
        of, time, camera = (side[is_probable] for side in view)
        expected = project_boxes(
            body, of * shape[1] + time, feet[of, time, camera], floor.homographies[camera]
        )
        picture, sample_picture = time * shape[2] + camera, samples.time * shape[2] + samples.camera
        touched = boxes_touching_others(
            expected, picture, samples.boxes, sample_picture, shape[1] * shape[2], self._size
        )
        clarity = self._clarity(floor, camera, expected)
        quality = _quality(expected, camera, clarity, floor.layout, self._quality_buffer.settings)
        quality *= probability[is_probable] * np.where(touched, 1.0, _NO_BOX_FACTOR)
        frame, each = self._frames_until_next(time, frames)
        return UndetectedViews(
            frame, floor.cameras[camera[each]], samples.people[of[each]], quality[each], tested
        )

    def _clarity(self, floor: _Floor, camera: Ints, boxes: Floats) -> Floats:
        """Return how clear the pictures of cameras (V,) of the floor are in boxes (V, 4), (V,)."""
        clarity = np.zeros(len(boxes))
        for column, at in enumerate(floor.cameras):
            here = camera == column
            clarity[here] = self._quality_buffer.clarity(self._cameras[at], boxes[here])
        return clarity

    def _frames_until_next(self, time: Ints, frames: int) -> tuple[Ints, Ints]:
        """Return the frames (F,) for which samples (V,) hold, up to the next one, and the sample of each."""
        frame = time * self._interval + np.arange(self._interval)[:, None]
        is_inside = frame < frames
        return frame[is_inside], np.broadcast_to(np.arange(len(time)), frame.shape)[is_inside]

    def learn(self, undetected: UndetectedViews, frames: int) -> None:
        """Learn from the first frames of a window, which are decided now."""
        tested = undetected.tested
        of = np.flatnonzero(tested.frame < frames)
        if not of.size:  # without people nothing is forgotten either
            return
        memory = math.exp(-frames / (_MEMORY_S * self._fps))
        # The next window begins with an inference: each test counts for the frames up to the next.
        frames_per_test = np.minimum(self._interval, frames - tested.frame[of]).astype(np.float64)
        self._detection_probability.learn(
            tested.camera[of], tested.feet[of], tested.found[of], frames_per_test, memory
        )

    def _floor(self) -> _Floor:
        known_size = [at for at, name in enumerate(self._cameras) if name in self._quality_buffer.letterboxes]
        layout = self._quality_buffer.layout([self._cameras[at] for at in known_size])
        known = [at for at, homography in enumerate(layout.homographies) if homography is not None]
        matrices = [layout.homographies[at] for at in known]
        return _Floor(
            np.array([known_size[at] for at in known], dtype=np.int64),
            replace(layout, picture_boxes=layout.picture_boxes[known], homographies=matrices),
            np.array(matrices, dtype=np.float64).reshape(-1, 3, 3),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Floor:
    """The C cameras whose picture size and homography are known.

    Attributes:
        cameras: (C,) by index of all cameras, rising.
        layout: the layout of these cameras.
        homographies: (C, 3, 3) from the site's picture to the ground.
    """

    cameras: Ints
    layout: CameraLayout
    homographies: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _DetectionSamples:
    """The boxes of C cameras in S sampled frames: B boxes, of P known people and of unknown ones.

    Attributes:
        people: (P,) indices of the known people, rising.
        boxes: (B, 4) pixels of the site's picture.
        person: (B,) index into `people`; -1: unknown.
        time: (B,) index of the sampled frame.
        camera: (B,) index among the C.
        can_detect: (S, C) whether the camera ran detection.
        detected: (P, S, C) whether it detected the person.
    """

    people: Ints
    boxes: Floats
    person: Ints
    time: Ints
    camera: Ints
    can_detect: Mask
    detected: Mask


def _detection_samples(
    tracks: WindowTracks, person: Ints, cameras: Ints, count: int, interval: int, frames: int
) -> _DetectionSamples:
    """Sample every `interval`-th frame of `cameras`, which are indices among `count`."""
    column = np.full(count, -1)
    column[cameras] = np.arange(len(cameras))
    sampled = (tracks.frame % interval == 0) & (column[tracks.camera] >= 0)
    can_detect = np.zeros((-(-frames // interval), len(cameras)), dtype=np.bool_)
    detecting = sampled & tracks.has_detection
    can_detect[tracks.frame[detecting] // interval, column[tracks.camera[detecting]]] = True
    boxes = np.flatnonzero(sampled[tracks.row] & (tracks.quality >= 0.0))
    row, index = tracks.row[boxes], person[boxes]
    people, place = np.unique(index, return_inverse=True)
    unknown = int(np.searchsorted(people, 0))  # 1 if any box is of an unknown person (-1), else 0
    people, place = people[unknown:], place - unknown
    time, camera, known = tracks.frame[row] // interval, column[tracks.camera[row]], place >= 0
    detected = np.zeros((len(people), *can_detect.shape), dtype=np.bool_)
    detected[place[known], time[known], camera[known]] = True
    return _DetectionSamples(people, tracks.boxes(boxes), place, time, camera, can_detect, detected)


def _quality(
    boxes: Floats, camera: Ints, clarity: Floats, layout: CameraLayout, settings: QualitySettings
) -> Floats:
    """Return the quality of V views by their boxes (V, 4), each by itself, (V,).

    Occlusion is left out: where two boxes overlap and one is inferred, either may be in front.
    """
    if not any(weight for name, weight in settings.weights.items() if name != "occlusion"):
        return np.ones(len(boxes))
    tracks = TrackWindow(boxes[:, None], camera, np.ones(len(boxes)), np.full(len(boxes), np.nan), clarity)
    return compute_view_quality(tracks, layout, replace(settings, occlusion=0.0)).quality[:, 0]
