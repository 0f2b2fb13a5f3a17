"""Trackers from the literature behind the interface of the network tracker, for comparison."""

from tracking.baselines.stepwise import StepwiseSettings, StepwiseTracker

__all__ = ["StepwiseSettings", "StepwiseTracker"]
