"""Warm-up of a recording's detector: the background is learned before the first frame."""

from __future__ import annotations

from server.camera.detector_setup import CameraDetector, LetterboxedDetections, make_detector
from server.camera.sources import PictureSource, Recording
from server.config.sections import CameraSettings
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from tracking.detectors import BackgroundDetector


def warm_up_detector(
    config: Config, camera: CameraSettings, source: PictureSource, fit: Letterbox
) -> CameraDetector:
    """Return a camera's detector, ready for the first frame where the source is a recording.

    The detector of a live camera learns its background while it runs.

    Raises:
        UserError: the detector's files or the recording cannot be read.
    """
    detector, settings = make_detector(config, camera, fit), config.detect
    if isinstance(detector, LetterboxedDetections) and isinstance(source, Recording):
        detector.number_frames_by(source.counted_pulse)
    if isinstance(detector, BackgroundDetector):
        places = range(0, settings.prescan_frames, settings.prescan_every)
        detector.prepare((fit.image(image) for image in source.ahead(places)), settings.prescan_every)
    return detector
