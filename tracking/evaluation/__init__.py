"""How good tracks are, against ground truth: HOTA, MOTA, IDF1, identity switches.

Needs the extra `evaluate` (`pip install myview[evaluate]`); the tracker itself does not use it.
"""

from tracking.evaluation.cameras import CameraScores, Recording, average, evaluate_cameras
from tracking.evaluation.occlusions import Occlusion, occlusions, survived
from tracking.evaluation.perfect import perfect_association
from tracking.evaluation.scores import Scores, evaluate
from tracking.evaluation.shown import HEADINGS, cells

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
