"""Detectors: where objects might be in a frame."""

from tracking.detectors.background import (
    PAPER_BOXES,
    BackgroundDetector,
    BackgroundSettings,
    paper_boxes,
    seen_from_above,
)
from tracking.detectors.base import Detector, Image
from tracking.detectors.boxfilter import BoxFilterSettings
from tracking.detectors.explain import ExplainSettings
from tracking.detectors.ghosts import GhostSettings
from tracking.detectors.heightline import Floor, HeightLineSettings
from tracking.detectors.hog import HogDetector, HogSettings
from tracking.detectors.looks import Looks, LooksSettings, colour_histograms
from tracking.detectors.median import MedianSettings
from tracking.detectors.mog2 import Mog2Settings
from tracking.detectors.motfile import MotFileDetector, MotFileSettings
from tracking.detectors.onnx import OnnxDetector, OnnxSettings
from tracking.detectors.subimage import SubimageSettings
from tracking.detectors.template import TemplateDetector, TemplateSettings

__all__ = [
    "PAPER_BOXES",
    "BackgroundDetector",
    "BackgroundSettings",
    "BoxFilterSettings",
    "Detector",
    "ExplainSettings",
    "Floor",
    "GhostSettings",
    "HeightLineSettings",
    "HogDetector",
    "HogSettings",
    "Image",
    "Looks",
    "LooksSettings",
    "MedianSettings",
    "Mog2Settings",
    "MotFileDetector",
    "MotFileSettings",
    "OnnxDetector",
    "OnnxSettings",
    "SubimageSettings",
    "TemplateDetector",
    "TemplateSettings",
    "colour_histograms",
    "paper_boxes",
    "seen_from_above",
]
