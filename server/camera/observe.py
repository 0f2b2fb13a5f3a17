"""A camera's detector, chosen and set up from the configuration."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from server.wire.config import Camera, Config
from server.wire.errors import UserError
from server.wire.fit import Fit, Image
from tracking import Detections
from tracking.detectors import (
    BackgroundDetector,
    BackgroundSettings,
    Detector,
    Looks,
    MotFileDetector,
    MotFileSettings,
)

_NO_PICTURE = np.empty((0, 0, 3), dtype=np.uint8)


class Observer(Detector, Protocol):
    """A detector that says how long the rows of its histograms are."""

    @property
    def bins(self) -> int:
        """Give that length: what a frame without a picture has to fit."""
        ...


def make_detector(config: Config, camera: Camera, fit: Fit) -> Observer:
    """Give the detector of a camera; its boxes are in the site's picture.

    Raises:
        UserError: the detection file cannot be read.
    """
    if camera.detections is not None:
        try:
            file = MotFileDetector(camera.detections, MotFileSettings(first_frame=camera.offset))
            return FittedDetections(file, fit, config.detect)
        except OSError as error:
            raise UserError(
                f"camera {camera.id}: detections: {camera.detections}: {error.strerror}"
            ) from error
        except ValueError as error:
            raise UserError(f"camera {camera.id}: detections: {error}") from error
    polygons = [fit.to_site(np.asarray(polygon, dtype=np.float64)) for polygon in camera.ignore]
    ignore = tuple(tuple((float(x), float(y)) for x, y in polygon) for polygon in polygons)
    return BackgroundDetector(replace(config.detect, ignore=(*config.detect.ignore, *ignore)))


class FittedDetections:
    """Detections from a file, which are in the camera's own pixels, moved into the site's picture."""

    def __init__(self, file: MotFileDetector, fit: Fit, settings: BackgroundSettings) -> None:
        self._file, self._fit = file, fit
        self._looks = Looks(settings.looks, settings.bins)

    @property
    def bins(self) -> int:
        """The length of a row of the histograms."""
        return self._looks.bins

    def detect(self, image: Image, frame: int | None = None) -> Detections:
        """Give the detections of a frame, with the appearance that the site's picture shows."""
        own = self._file.detect(_NO_PICTURE, frame)
        boxes = self._fit.boxes_to_site(own.boxes)
        return Detections(boxes, own.scores, self._looks.rows(image, boxes))
