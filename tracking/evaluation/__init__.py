"""Evaluation against ground truth: HOTA, MOTA, IDF1, identity switches, occlusions.

Needs the extra `evaluate` (`pip install myview[evaluate]`); the tracker itself does not use it.
"""

from tracking.evaluation.multi_camera import (
    MultiCameraScores,
    TruthAndTracks,
    average_scores,
    evaluate_cameras,
)
from tracking.evaluation.occlusions import Occlusion, find_occlusions, identities_kept
from tracking.evaluation.oracle_association import oracle_association
from tracking.evaluation.track_scores import HEADINGS, Scores, evaluate, format_scores

__all__ = [
    "HEADINGS",
    "MultiCameraScores",
    "Occlusion",
    "Scores",
    "TruthAndTracks",
    "average_scores",
    "evaluate",
    "evaluate_cameras",
    "find_occlusions",
    "format_scores",
    "identities_kept",
    "oracle_association",
]
