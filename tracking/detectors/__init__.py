"""Detectors: where objects might be in a frame."""

from tracking.detectors.background.box_filter import BoxFilterSettings
from tracking.detectors.background.detector import (
    PAPER_BOXES,
    BackgroundDetector,
    BackgroundSettings,
    paper_boxes,
    seen_from_above,
)
from tracking.detectors.background.foreground_fit import ExplainSettings
from tracking.detectors.background.height_model import Floor, HeightLineSettings
from tracking.detectors.background.median import MedianSettings
from tracking.detectors.background.mog2 import Mog2Settings
from tracking.detectors.background.static_foreground import GhostSettings
from tracking.detectors.base import Detector, Image
from tracking.detectors.color_histogram import Looks, LooksSettings, colour_histograms
from tracking.detectors.hog import HogDetector, HogSettings
from tracking.detectors.mot_file import MotFileDetector, MotFileSettings
from tracking.detectors.neural.onnx import OnnxDetector, OnnxSettings
from tracking.detectors.subimage_appearance import SubimageSettings
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
