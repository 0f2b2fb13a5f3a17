"""The operator who helps: troubles are foreseen, and a pointing is taken (Todor 2009, chapter 8)."""

from tracking.interactive.corrections import Pointing
from tracking.interactive.risk import Signs
from tracking.interactive.risk_prediction import Foresight
from tracking.interactive.settings import AssistSettings
from tracking.interactive.swap_margins import Exchanges, exchange_margins, exchanges
from tracking.interactive.tracker import AssistedTracker
from tracking.types import RiskEvent, RiskReason

__all__ = [
    "AssistSettings",
    "AssistedTracker",
    "Exchanges",
    "Foresight",
    "Pointing",
    "RiskEvent",
    "RiskReason",
    "Signs",
    "exchange_margins",
    "exchanges",
]
