"""Synthetic scenes with ground truth: a live camera source, and recordings for measurements."""

from synthetic.catalog import scene_names
from synthetic.ground_truth import CameraTruth
from synthetic.recording import has_ground, write_recording
from synthetic.scene import Scene

__all__ = ["CameraTruth", "Scene", "has_ground", "scene_names", "write_recording"]
