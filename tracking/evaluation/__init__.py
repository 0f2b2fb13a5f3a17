"""How good tracks are, against ground truth: HOTA, MOTA, IDF1, identity switches.

Needs the extra `evaluate` (`pip install myview[evaluate]`); the tracker itself does not use it.
"""

from tracking.evaluation.cameras import CameraScores, Recording, average, evaluate_cameras
from tracking.evaluation.perfect import perfect_association
from tracking.evaluation.scores import Scores, evaluate
from tracking.evaluation.shown import HEADINGS, cells

__all__ = [
    "HEADINGS",
    "CameraScores",
    "Recording",
    "Scores",
    "average",
    "cells",
    "evaluate",
    "evaluate_cameras",
    "perfect_association",
]
