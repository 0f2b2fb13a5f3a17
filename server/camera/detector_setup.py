"""Creates a camera's detector as configured; for a recording, the background is learned in advance."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Protocol

import numpy as np

from bestview import camera_height, horizon_row
from server.camera.detector_choice import choose_detector, describe_detector
from server.camera.sources import FrameSource, ImageFolder, Recording
from server.config.ground_unit import UNITS_PER_METER
from server.config.sections import CameraSettings
from server.config.sections.detect import DetectSettings
from server.config.site_config import Config
from server.media.letterbox import Image, Letterbox
from server.models.installed import check_installed
from server.system.errors import UserError, reason_of
from tracking import Detections
from tracking.detectors import (
    AppearanceExtractor,
    BackgroundDetector,
    Detector,
    FloorGeometry,
    FusedDetector,
    HogDetector,
    MotFileDetector,
    MotFileSettings,
    OnnxDetector,
    overhead_settings,
    paper_settings,
)

log = logging.getLogger(__name__)

_NO_IMAGE = np.empty((0, 0, 3), dtype=np.uint8)


class CameraDetector(Detector, Protocol):
    """A detector that also knows its histograms' length and whether it is still warming up."""

    @property
    def appearance_bins(self) -> int:
        """Bins of a detection's appearance histogram."""
        ...

    @property
    def warming_up(self) -> bool:
        """Whether detection did not run on the last frame: an empty result does not mean an empty room."""
        ...


def make_detector(config: Config, camera: CameraSettings, letterbox: Letterbox) -> CameraDetector:
    """Return the detector of a camera; boxes are in pixels of the site's image.

    Raises:
        UserError: the detection file or the network cannot be read, or the network cannot be run.
    """
    if camera.detections is not None:
        with _as_user_error(f"camera {camera.id}: detections"):
            file = MotFileDetector(
                camera.detections, MotFileSettings(first_frame=camera.first_pulse(config.site.fps))
            )
            return LetterboxedDetections(file, letterbox, config.detect)
    polygons = [letterbox.camera_to_site(np.asarray(polygon, dtype=np.float64)) for polygon in camera.ignore]
    ignore = tuple(tuple((float(x), float(y)) for x, y in polygon) for polygon in polygons)
    with _as_user_error(f"camera {camera.id}: detect"):
        chosen = choose_detector(config.detect, camera)
        settings = replace(chosen, ignore=(*chosen.ignore, *ignore))
        if camera.kind == "overhead":
            return _create_detector(overhead_settings(settings), None, config.site.fps)
        return _create_detector(settings, _floor(config, camera, letterbox), config.site.fps)


def make_prescanned_detector(
    config: Config,
    camera: CameraSettings,
    source: FrameSource,
    letterbox: Letterbox,
    tracked_images: Callable[[Sequence[int]], Iterator[Image]] | None = None,
) -> CameraDetector:
    """Return a camera's detector; for a recording it has learned the background by a prescan.

    The detector of a live camera learns the background while it runs. ``tracked_images`` returns the pictures
    of some frames as they will be searched, if those are not the source's.

    Raises:
        UserError: the detector's files or the recording cannot be read.
    """
    detector, settings = make_detector(config, camera, letterbox), config.detect
    log.info("camera %s: people are detected by: %s", camera.id, describe_detector(detector))
    if isinstance(detector, LetterboxedDetections) and isinstance(source, Recording | ImageFolder):
        detector.number_frames_by(source.pulse_by_frame_count)
    if isinstance(detector, BackgroundDetector | FusedDetector):
        indices = settings.prescan_frames(config.site.fps)
        images = (
            (letterbox.image(image) for image in source.prescan_images(indices))
            if tracked_images is None
            else tracked_images(indices)
        )
        detector.prepare(images, indices.step / config.site.fps)
    return detector


_PERSON_M = 1.7
_MIN_SLOPE, _MAX_SLOPE = 0.03, 1.5
"""Limits of a person's height over the camera's: cameras at 1.1 to 57 meters. Beyond, the unit is probably
wrong."""


def _floor(config: Config, camera: CameraSettings, letterbox: Letterbox) -> FloorGeometry | None:
    """Return the horizon and height of people that follow from the homography; None: unknown."""
    per_meter = UNITS_PER_METER.get(camera.ground_unit or "")
    if camera.ground is None:
        return None
    homography = np.array(camera.ground, dtype=np.float64)
    width, height = config.site.width, config.site.height
    middle = float(letterbox.site_to_camera(np.array([width / 2.0, 0.0]))[0])
    row = horizon_row(homography, middle)
    if row is None:
        return None
    horizon = float(letterbox.camera_to_site(np.array([middle, row]))[1])
    # With a horizon below the middle of the image, the homography hardly constrains people's heights.
    if horizon > height / 2.0:
        return None
    if per_meter is None:
        # A horizon far above the image is uncertain, and the camera height, which could confirm it, is
        # unknown.
        return FloorGeometry(horizon, None) if horizon >= -height else None
    above = camera_height(homography, middle)
    slope = _PERSON_M * per_meter / above if above else 0.0
    return FloorGeometry(horizon, slope) if _MIN_SLOPE <= slope <= _MAX_SLOPE else None


def _create_detector(settings: DetectSettings, floor: FloorGeometry | None, fps: float) -> CameraDetector:
    """Return the detector that the settings name."""
    appearance = AppearanceExtractor(settings.appearance, settings.gray_bins)
    match settings.kind:
        case "hog":
            return HogDetector(settings.hog, appearance, settings.ignore)
        case "onnx":
            return _open_network(settings, appearance)
        case "fused":
            background = BackgroundDetector(settings, floor, fps)
            return FusedDetector(background, _open_network(settings, appearance), settings.fused)
        case "boxes":
            return BackgroundDetector(paper_settings(settings), fps=fps)
        case "background" | "auto":
            return BackgroundDetector(settings, floor, fps)


def _open_network(settings: DetectSettings, appearance: AppearanceExtractor) -> OnnxDetector:
    if settings.onnx.model is not None:
        check_installed(settings.onnx.model)
    return OnnxDetector(settings.onnx, appearance, settings.ignore)


@contextmanager
def _as_user_error(where: str) -> Iterator[None]:
    """Turn errors into a `UserError` of one line that begins with ``where``.

    Raises:
        UserError: a file or network is missing or invalid.
    """
    try:
        yield
    except OSError as error:
        raise UserError(f"{where}: {error.filename}: {reason_of(error)}") from error
    except (ValueError, ImportError) as error:
        raise UserError(f"{where}: {error}") from error


class LetterboxedDetections:
    """Detections from a file, mapped from the camera's image to the site's."""

    warming_up = False

    def __init__(self, file: MotFileDetector, letterbox: Letterbox, settings: DetectSettings) -> None:
        self._file, self._letterbox = file, letterbox
        self._appearance = AppearanceExtractor(settings.appearance, settings.gray_bins)
        self._frame_number: Callable[[int], int] = int

    def number_frames_by(self, frame_number: Callable[[int], int]) -> None:
        """Set the mapping from pulses to the file's frame numbers, which count the recording's frames."""
        self._frame_number = frame_number

    @property
    def appearance_bins(self) -> int:
        """Bins of a detection's appearance histogram."""
        return self._appearance.bins

    def detect(self, image: Image, frame: int | None = None) -> Detections:
        """Return the detections of a frame, with appearance histograms from the site's image."""
        from_file = self._file.detect(_NO_IMAGE, None if frame is None else self._frame_number(frame))
        boxes = self._letterbox.boxes_camera_to_site(from_file.boxes)
        return Detections(boxes, from_file.scores, self._appearance.histograms(image, boxes))
