"""Evaluation of view selections: ground truth of view quality, offline optimum, and scores."""

from bestview.evaluation.ground_truth import (
    NO_PERSON,
    ViewGroundTruth,
    assign_objects_one_to_one,
    optimal_views,
    view_ground_truth,
)
from bestview.evaluation.view_scores import ViewScore, cut_frames, score_views

__all__ = [
    "NO_PERSON",
    "ViewGroundTruth",
    "ViewScore",
    "assign_objects_one_to_one",
    "cut_frames",
    "optimal_views",
    "score_views",
    "view_ground_truth",
]
