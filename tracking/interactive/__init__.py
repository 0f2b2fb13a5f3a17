"""Interactive tracking: risk prediction and operator corrections (Todor 2009, chapter 8)."""

from tracking.interactive.corrections import PositionCorrection
from tracking.interactive.risk import RiskFeatures, RiskPredictor
from tracking.interactive.settings import InteractiveSettings
from tracking.interactive.swap_margins import SwapMargins, swap_margin_matrix, swap_margins
from tracking.interactive.tracker import InteractiveTracker
from tracking.types import RiskEvent, RiskReason

__all__ = [
    "InteractiveSettings",
    "InteractiveTracker",
    "PositionCorrection",
    "RiskEvent",
    "RiskFeatures",
    "RiskPredictor",
    "RiskReason",
    "SwapMargins",
    "swap_margin_matrix",
    "swap_margins",
]
