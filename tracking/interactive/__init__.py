"""Interactive tracking: risk prediction and operator corrections (Todor 2009, chapter 8)."""

from tracking.interactive.corrections import PositionCorrection
from tracking.interactive.risk import RiskFeatures, RiskPredictor
from tracking.interactive.settings import InteractiveSettings
from tracking.interactive.swap_margins import CheapestSwaps, find_cheapest_swaps, swap_margin_matrix
from tracking.interactive.tracker import CorrectableTracker
from tracking.types import RiskEvent, RiskReason

__all__ = [
    "CheapestSwaps",
    "CorrectableTracker",
    "InteractiveSettings",
    "PositionCorrection",
    "RiskEvent",
    "RiskFeatures",
    "RiskPredictor",
    "RiskReason",
    "find_cheapest_swaps",
    "swap_margin_matrix",
]
