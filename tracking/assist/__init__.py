"""The operator who helps: troubles are foreseen, and a pointing is taken (Todor 2009, chapter 8)."""

from tracking.assist.exchange import Exchanges, exchange_margins, exchanges
from tracking.assist.foresight import Foresight
from tracking.assist.pointing import Pointing
from tracking.assist.risk import Signs
from tracking.assist.settings import AssistSettings
from tracking.assist.tracker import AssistedTracker
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
