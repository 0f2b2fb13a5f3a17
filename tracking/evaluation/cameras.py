"""Scores of several cameras that share their people's numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tracking.evaluation.frames import line_up
from tracking.evaluation.scores import DEFAULT_IOU, Scores, score
from tracking.motchallenge import MotRow


@dataclass(frozen=True, slots=True)
class Recording:
    """One camera: what is there and what was found."""

    truth: Sequence[MotRow]
    tracks: Sequence[MotRow]


@dataclass(frozen=True, slots=True)
class CameraScores:
    """Scores by camera, and of all of them as one.

    Attributes:
        cameras: each camera for itself, by name.
        joint: the frames of all cameras, put one after the other. A number is one person in all of them,
            in the truth and in the tracks, so that whoever has another number in another camera is
            wrong there: `joint.idf1` is the joint IDF1.
    """

    cameras: dict[str, Scores]
    joint: Scores


def evaluate_cameras(cameras: Mapping[str, Recording], least_iou: float = DEFAULT_IOU) -> CameraScores:
    """Score the tracks of several cameras, each and together.

    Raises:
        ValueError: an id is twice in one frame of one camera.
    """
    frames = {name: line_up(it.truth, it.tracks, least_iou) for name, it in cameras.items()}
    return CameraScores(
        cameras={name: score(found, least_iou) for name, found in frames.items()},
        joint=score([frame for found in frames.values() for frame in found], least_iou),
    )
