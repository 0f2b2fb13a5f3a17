"""Evaluation of view selections: ground truth of view quality, offline optimum, and scores."""

from bestview.evaluation.ground_truth import (
    NO_PERSON,
    ViewGroundTruth,
    match_objects_to_people,
    optimal_views,
    view_ground_truth,
)
from bestview.evaluation.view_scores import ViewScore, cut_frames, score_views

__all__ = [
    "NO_PERSON",
    "ViewGroundTruth",
    "ViewScore",
    "cut_frames",
    "match_objects_to_people",
    "optimal_views",
    "score_views",
    "view_ground_truth",
]
