"""Ground truth of several cameras: boxes and visibility of people, and matching of objects to people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview import NO_PERSON, ViewGroundTruth, assign_objects_one_to_one, view_ground_truth
from server.cli.render.video_info import Size
from server.system.errors import UserError
from tracking.evaluation import TruthAndTracks
from tracking.evaluation.frame_matching import align_frames
from tracking.motchallenge import MotRow

LEAST_SHOWN = 0.25
"""Visible share of a person from which a view shows them."""


@dataclass(frozen=True, slots=True, eq=False)
class SceneTruth:
    """The ground truth of all cameras.

    Attributes:
        people: the K numbers of people in the ground truth, sorted.
        cameras: the names of the C cameras.
        boxes: (K, N, C, 4) left, top, right, bottom in pixels; NaN where the person is not in the
            picture. Row n is frame n + 1 of the files.
        views: (K, N, C) costs and visibility of each view.
    """

    people: tuple[int, ...]
    cameras: tuple[str, ...]
    boxes: NDArray[np.float64]
    views: ViewGroundTruth


def build_truth(
    rows: Mapping[str, Sequence[MotRow]], sizes: Mapping[str, Size], least_shown: float = LEAST_SHOWN
) -> SceneTruth:
    """Build the ground truth of several cameras with common person numbers.

    Rows with confidence 0 are ignored, as in `tracking.evaluation`.

    Raises:
        UserError: a person is twice in one frame of a camera.
    """
    counted = {
        camera: [row for row in camera_rows if row.confidence != 0.0] for camera, camera_rows in rows.items()
    }
    people = sorted({row.id for camera_rows in counted.values() for row in camera_rows})
    last = max((row.frame for camera_rows in counted.values() for row in camera_rows), default=0)
    place = {number: index for index, number in enumerate(people)}
    boxes = np.full((len(people), last, len(counted), 4), np.nan)
    shown = np.full(boxes.shape[:3], -1.0)
    for camera, (name, camera_rows) in enumerate(counted.items()):
        for row in camera_rows:
            if not np.isnan(boxes[place[row.id], row.frame - 1, camera, 0]):
                raise UserError(f"--gt: camera {name}: person {row.id} is twice in frame {row.frame}")
            boxes[place[row.id], row.frame - 1, camera] = row.box
            shown[place[row.id], row.frame - 1, camera] = row.visible
    pictures = np.array([sizes[camera] for camera in counted], dtype=np.float64).reshape(-1, 2)
    views = view_ground_truth(boxes, shown, pictures, least_shown)
    return SceneTruth(tuple(people), tuple(counted), boxes, views)


def people_of_objects(
    people: Sequence[int], recordings: Mapping[str, TruthAndTracks], least_iou: float
) -> dict[int, int]:
    """Return the person of each object that matches one.

    Raises:
        ValueError: an id is twice in one frame of a camera.
    """
    objects = sorted({row.id for recording in recordings.values() for row in recording.tracks})
    person_at = {number: index for index, number in enumerate(people)}
    object_at = {number: index for index, number in enumerate(objects)}
    matches = np.zeros((len(people), len(objects)), dtype=np.int64)
    for camera, recording in recordings.items():
        try:
            frames = align_frames(recording.truth, recording.tracks, least_iou)
        except ValueError as error:
            raise ValueError(f"{camera}: {error}") from None
        for frame in frames:
            for row, column in zip(*np.nonzero(frame.similarity >= least_iou), strict=True):
                person, number = int(frame.truth[row]), int(frame.tracks[column])
                matches[person_at[person], object_at[number]] += 1
    matched = assign_objects_one_to_one(matches).tolist()
    return {
        number: people[person] for number, person in zip(objects, matched, strict=True) if person != NO_PERSON
    }
