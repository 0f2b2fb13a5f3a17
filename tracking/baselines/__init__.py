"""The trackers of the survey behind the interface of the network's: to measure it beside them."""

from tracking.baselines.stepwise import StepwiseSettings, StepwiseTracker
from tracking.registry import (
    DEFAULT_TRACKER,
    TEMPORAL,
    Preparing,
    Tracker,
    needs_pictures,
    tracker_named,
    tracker_names,
)

__all__ = [
    "DEFAULT_TRACKER",
    "TEMPORAL",
    "Preparing",
    "StepwiseSettings",
    "StepwiseTracker",
    "Tracker",
    "needs_pictures",
    "tracker_named",
    "tracker_names",
]
