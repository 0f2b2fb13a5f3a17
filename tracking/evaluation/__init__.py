"""How good tracks are, against ground truth: HOTA, MOTA, IDF1, identity switches.

Needs the extra `evaluate` (`pip install myview[evaluate]`); the tracker itself does not use it.
"""

from tracking.evaluation.formatting import HEADINGS, cells
from tracking.evaluation.multi_camera import CameraScores, Recording, average, evaluate_cameras
from tracking.evaluation.occlusions import Occlusion, occlusions, survived
from tracking.evaluation.oracle_association import perfect_association
from tracking.evaluation.scores import Scores, evaluate

__all__ = [
    "HEADINGS",
    "CameraScores",
    "Occlusion",
    "Recording",
    "Scores",
    "average",
    "cells",
    "evaluate",
    "evaluate_cameras",
    "occlusions",
    "perfect_association",
    "survived",
]
