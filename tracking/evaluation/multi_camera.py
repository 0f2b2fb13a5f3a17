"""Scores of several cameras with shared ids."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from statistics import fmean
from typing import Any

from tracking.evaluation.frame_matching import FrameSimilarity, align_frames
from tracking.evaluation.track_scores import DEFAULT_MIN_IOU, Scores, score_frames
from tracking.motchallenge import MotRow


@dataclass(frozen=True, slots=True)
class TruthAndTracks:
    """Ground truth and tracks of one camera."""

    truth: Sequence[MotRow]
    tracks: Sequence[MotRow]


@dataclass(frozen=True, slots=True)
class MultiCameraScores:
    """Scores per camera and of all cameras together.

    Attributes:
        cameras: the scores of each camera, by name.
        joint: the scores of the concatenated frames of all cameras. An id means one person in all cameras, in
            the truth and in the tracks, so a person with different ids in two cameras is an error:
            `joint.idf1` is the joint IDF1.
    """

    cameras: dict[str, Scores]
    joint: Scores

    @property
    def mean(self) -> Scores:
        """The scores over the cameras: shares are unweighted means, counts are totals."""
        return average_scores(list(self.cameras.values()))


def average_scores(scores: Sequence[Scores]) -> Scores:
    """Return the mean of the shares and the total of the counts.

    Raises:
        ValueError: there are no scores.
    """
    if not scores:
        raise ValueError("there are no scores to average")
    columns: dict[str, Any] = {}
    for field in fields(Scores):
        values = [getattr(score, field.name) for score in scores]
        columns[field.name] = sum(values) if isinstance(values[0], int) else fmean(values)
    return Scores(**columns)


def evaluate_cameras(
    cameras: Mapping[str, TruthAndTracks], min_iou: float = DEFAULT_MIN_IOU
) -> MultiCameraScores:
    """Score the tracks of several cameras, separately and together.

    Raises:
        ValueError: an id occurs twice in one frame of a camera; the message names the camera.
    """
    frames: dict[str, list[FrameSimilarity]] = {}
    for name, camera in cameras.items():
        try:
            frames[name] = align_frames(camera.truth, camera.tracks, min_iou)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
    return MultiCameraScores(
        cameras={name: score_frames(found, min_iou) for name, found in frames.items()},
        joint=score_frames([frame for found in frames.values() for frame in found], min_iou),
    )
