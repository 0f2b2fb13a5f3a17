"""Synthetic scenes with ground truth: a live camera source, and recordings for anyone to measure on."""

from server.camera.scene.catalogue import scene_names
from server.camera.scene.recording import has_ground, write_recording
from server.camera.scene.scene import Scene
from server.camera.scene.truth import CameraTruth

__all__ = ["CameraTruth", "Scene", "has_ground", "scene_names", "write_recording"]
