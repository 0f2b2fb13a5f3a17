"""Trackers from the literature behind the interface of the network tracker, for comparison."""

from tracking.baselines.frame_by_frame import StepwiseSettings
from tracking.baselines.stepwise import StepwiseTracker

__all__ = ["StepwiseSettings", "StepwiseTracker"]
