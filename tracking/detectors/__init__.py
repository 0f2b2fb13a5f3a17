"""Detectors: candidate boxes with scores and histograms."""

from tracking.detectors.background.box_filter import BoxFilterSettings
from tracking.detectors.background.detector import BackgroundDetector
from tracking.detectors.background.foreground_fit import ForegroundFitSettings
from tracking.detectors.background.height_model import FloorGeometry, HeightModelSettings
from tracking.detectors.background.median import MedianSettings
from tracking.detectors.background.mog2 import Mog2Settings
from tracking.detectors.background.settings import (
    PAPER_DETECTOR,
    BackgroundSettings,
    overhead_settings,
    paper_settings,
)
from tracking.detectors.background.static_foreground import StaticForegroundSettings
from tracking.detectors.base import Detector, Image
from tracking.detectors.color_histogram import AppearanceExtractor, AppearanceSettings, color_histograms
from tracking.detectors.fused.detector import FusedDetector, FusedSettings
from tracking.detectors.hog import HogDetector, HogSettings
from tracking.detectors.mot_file import MotFileDetector, MotFileSettings
from tracking.detectors.neural.onnx import OnnxDetector, OnnxSettings
from tracking.detectors.template import SubimageSettings, TemplateDetector, TemplateSettings

__all__ = [
    "PAPER_DETECTOR",
    "AppearanceExtractor",
    "AppearanceSettings",
    "BackgroundDetector",
    "BackgroundSettings",
    "BoxFilterSettings",
    "Detector",
    "FloorGeometry",
    "ForegroundFitSettings",
    "FusedDetector",
    "FusedSettings",
    "HeightModelSettings",
    "HogDetector",
    "HogSettings",
    "Image",
    "MedianSettings",
    "Mog2Settings",
    "MotFileDetector",
    "MotFileSettings",
    "OnnxDetector",
    "OnnxSettings",
    "StaticForegroundSettings",
    "SubimageSettings",
    "TemplateDetector",
    "TemplateSettings",
    "color_histograms",
    "overhead_settings",
    "paper_settings",
]
