"""The default detector: people as foreground of a learned background (paper IV.A.2)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from tracking.detectors.background.box_filter import BoxFilter, HeightRange, ScanPeaks
from tracking.detectors.background.cell_grid import CellGrid
from tracking.detectors.background.foreground_fit import (
    ForegroundFitSettings,
    fit_foreground,
    shrink_to_foreground,
)
from tracking.detectors.background.height_model import (
    FloorGeometry,
    HeightModel,
    HeightModelEstimator,
)
from tracking.detectors.background.isolated_people import IsolatedPerson
from tracking.detectors.background.median import MedianBackground
from tracking.detectors.background.mog2 import Mog2Background
from tracking.detectors.background.motion import STILL, Motion
from tracking.detectors.background.segmentation import (
    Segmentation,
    clean_mask,
    occupied_mask,
)
from tracking.detectors.background.settings import BackgroundSettings
from tracking.detectors.base import Image, Mask, Plane, validate_image
from tracking.detectors.color_histogram import AppearanceExtractor
from tracking.detectors.ignore_mask import move_polygons
from tracking.frame_rate import DEFAULT_FPS
from tracking.types import Detections

# Pixels of the working image per cell of the box filter, on each axis.
CELL = 2


@dataclass(frozen=True, slots=True, eq=False)
class ForegroundScan:
    """A frame's foreground, and where in it people could be.

    Attributes:
        image: the working image, `(h, w, 3)`, moved to where the background is, as are all other planes.
        mask: its foreground, `(h, w)`, 255 where a person may be visible.
        foreground: share of foreground per cell, `(H, W)`.
        cost: cost of the background in each cell to a covering body, `(H, W)`.
        weight: 1 in visible cells, `(H, W)`.
        peaks: candidates, in cells.
        fit: the settings of the fit, as far as the height model is known.
        motion: where the background is in the frame.
    """

    image: Image
    mask: Mask
    foreground: Plane
    cost: Plane
    weight: Plane
    peaks: ScanPeaks
    fit: ForegroundFitSettings
    motion: Motion = STILL


class _Background(Protocol):
    def segment(self, image: Image) -> Segmentation | None: ...

    def learn(self, foreground: Mask, occupied: Mask) -> None: ...


class BackgroundDetector:
    """Detects standing people in one camera's foreground. Deterministic; warms up for about a second."""

    def __init__(
        self,
        settings: BackgroundSettings | None = None,
        floor: FloorGeometry | None = None,
        fps: float = DEFAULT_FPS,
    ) -> None:
        """Start without a background; `floor` is the calibrated floor geometry, if known."""
        self.settings = settings or BackgroundSettings()
        self.fps = fps
        self._appearance = AppearanceExtractor(self.settings.appearance, self.settings.gray_bins)
        self._floor = floor
        self._height_estimator = HeightModelEstimator(self.settings.height_model, fps)
        self._background: _Background = (
            MedianBackground(
                self.settings.median, self.settings.static_foreground, self.settings.shadows, fps
            )
            if self.settings.model == "median"
            else Mog2Background(self.settings.mog2, fps)
        )
        self._shape = (0, 0)
        self._grid: CellGrid | None = None
        self._filter: BoxFilter | None = None
        self._height_model: HeightModel | None = None
        self._height_range: HeightRange | None = None
        self._views = 0
        self._covered: npt.NDArray[np.float64] = np.empty((0, 4))
        self._turned: npt.NDArray[np.float64] | None = None
        """How the present view, if it is not the first one, was turned; of the working image."""
        self.warming_up = True
        """Whether the last frame could not be searched because the background was unknown."""

    def prepare(self, images: Iterable[Image], every_s: float) -> None:
        """Learn the background and the height model from a recording before its first frame.

        Args:
            images: images of the recording, people included; they are consumed one by one.
            every_s: seconds of the recording per image.

        Raises:
            ValueError: not `(H, W, 3)` uint8 images of one size.
        """
        background = self._background
        if not isinstance(background, MedianBackground):
            return
        work_images = [self.to_work_image(image) for image in images]
        background.prepare(work_images)
        for work_image in work_images:
            segmentation = background.segment_still(work_image)
            if segmentation is not None and self._grid is not None:
                self._height_estimator.sample(
                    clean_mask(segmentation.foreground & self._grid.visible), self._grid.visible, every_s
                )

    def detect(self, image: Image, frame: int | None = None) -> Detections:  # noqa: ARG002 — Detector
        """Return the detections of the next frame; none while the background is unknown.

        Raises:
            ValueError: not an `(H, W, 3)` uint8 image, or another size than before.
        """
        scan = self.scan(self.to_work_image(image))
        if scan is None:
            return Detections.empty(self.appearance_bins)
        found = fit_foreground(scan.peaks, scan.foreground, scan.cost, scan.weight, scan.fit)
        boxes = shrink_to_foreground(found.boxes, scan.foreground, scan.weight)
        self.learn(scan, boxes[: found.person_count])
        return self.detections(scan.image, boxes, found.scores, scan.mask, scan.motion)

    def to_work_image(self, image: Image) -> Image:
        """Return an image in the size that is searched, `(h, w, 3)`.

        Raises:
            ValueError: not an `(H, W, 3)` uint8 image, or another size than before.
        """
        return self._grid_for(image).resize(image)

    def scan(self, work_image: Image) -> ForegroundScan | None:
        """Segment and scan the next frame, which `learn` completes; `None`: the background is unknown."""
        self._follow_view()
        grid = self.grid
        segmentation = self._background.segment(work_image)
        self.warming_up = segmentation is None
        if segmentation is None:
            return None
        mask = clean_mask(segmentation.foreground & grid.visible)
        self._height_estimator.observe(mask, grid.visible)
        shadow = segmentation.shadow & grid.visible & ~mask
        return replace(self._scan_mask(segmentation.image, mask, shadow, grid), motion=segmentation.motion)

    def relit(self, image: Image) -> Image:
        """Return the image of the last frame scanned in the background's light, if it is dark or hazy."""
        background = self._background
        return background.relit(image) if isinstance(background, MedianBackground) else image

    @property
    def flicker(self) -> Mask | None:
        """Where leaves or screens flicker in the images, `(h, w)` of 255, else 0; None: nowhere."""
        return self._background.flicker.mask if isinstance(self._background, MedianBackground) else None

    def cover(self, boxes: npt.NDArray[np.float64]) -> None:
        """Ignore the covered part of the images, rectangles `(K, 4)` in pixels, from the next frame on.

        Instead of what was covered before. What is behind it is remembered.
        """
        self._covered = boxes
        if self._grid is not None:
            self._hide_covered(self._grid)

    def _hide_covered(self, grid: CellGrid) -> None:
        grid.hide(self._covered)
        if self._filter is not None:
            self._filter.see(grid.weight)
        if isinstance(self._background, MedianBackground):
            self._background.hidden = None if not len(self._covered) else ~grid.visible

    def learn(self, scan: ForegroundScan, people: npt.NDArray[np.float64]) -> None:
        """Update the background with the frame of a scan where nobody is; `people` `(K, 4)` are in cells."""
        boxes = self.grid.cells_to_work(people)
        self._background.learn(scan.mask, occupied_mask(boxes, scan.mask.shape))

    def observe_people(self, boxes: npt.NDArray[np.float64], represented_s: float) -> None:
        """Learn the height of people from whole people of one frame, boxes `(K, 4)` in cells.

        They replace the blobs from which it is learned otherwise; the frame represents so many seconds.
        """
        in_work = self.grid.cells_to_work(boxes)
        self._height_estimator.observe_people(
            [IsolatedPerson((box[0] + box[2]) / 2.0, box[3], box[3] - box[1]) for box in in_work.tolist()],
            represented_s,
        )

    def detections(
        self,
        work_image: Image,
        boxes: npt.NDArray[np.float64],
        scores: npt.NDArray[np.float64],
        mask: Mask | None = None,
        motion: Motion = STILL,
    ) -> Detections:
        """Return boxes `(K, 4)` in cells as detections, with the appearance of their pixels in the mask.

        `motion`: where the background, and so the image's content, is in the frame.
        """
        in_work = self.grid.cells_to_work(boxes)
        histograms = self._appearance.histograms(work_image, in_work, mask)
        if motion != STILL:
            in_work = motion.move_boxes(in_work, (work_image.shape[1], work_image.shape[0]))
        return Detections(self.grid.work_to_image(in_work), scores, histograms)

    def to_cells(self, boxes: npt.NDArray[np.float64], motion: Motion = STILL) -> npt.NDArray[np.float64]:
        """Return boxes `(N, 4)` of a frame, in pixels of the working image, in cells of the background."""
        if motion != STILL:
            boxes = motion.move_boxes_back(boxes, self.grid.work_size)
        return self.grid.work_to_cells(boxes)

    @property
    def grid(self) -> CellGrid:
        """The cells of the images.

        Raises:
            ValueError: there was no image yet.
        """
        if self._grid is None:
            raise ValueError("the size of the images is not known yet")
        return self._grid

    def _follow_view(self) -> None:
        """Begin anew with a view that is learned; move ignored areas and floor there once it is located."""
        background = self._background
        if not isinstance(background, MedianBackground):
            return
        if background.views != self._views:
            self._views = background.views
            self._height_estimator = HeightModelEstimator(self.settings.height_model, self.fps)
        turned = background.turned
        if self._views and turned is not self._turned:
            self._turned = turned
            if turned is not None:
                self._lay_grid(turned)

    def _lay_grid(self, turned: npt.NDArray[np.float64] | None) -> CellGrid:
        """Lay the cells over the images, and take over what the floor says of heights.

        `turned`: how the camera was turned since it was calibrated, (3, 3), working image; None: it was not.
        """
        settings, floor, ignore = self.settings, self._floor, self.settings.ignore
        if turned is not None:
            scale = np.diag([self.grid.work_scale, self.grid.work_scale, 1.0])
            in_image = np.asarray(np.linalg.inv(scale) @ turned @ scale)
            ignore = move_polygons(ignore, in_image)
            floor = None if floor is None else floor.turned(in_image, self._shape[1])
            self._filter = self._height_model = self._height_range = None
        grid = self._grid = CellGrid(self._shape, settings.work_width, CELL, settings.border_margin, ignore)
        if len(self._covered):
            self._hide_covered(grid)
        if floor is not None:
            self._height_estimator = HeightModelEstimator(
                settings.height_model, self.fps, floor.scaled_by(grid.work_scale), grid.work_height
            )
        return grid

    @property
    def camera_motion(self) -> npt.NDArray[np.float64] | None:
        """How the picture has moved to where the camera rests: a homography (3, 3) of pixels of the images.

        None: the camera was turned to a view that could not be located.
        """
        if self._grid is None or not isinstance(self._background, MedianBackground):
            return np.eye(3)
        moved = self._background.moved(self._grid.work_size)
        scale = np.diag([self._grid.work_scale, self._grid.work_scale, 1.0])
        return None if moved is None else np.asarray(np.linalg.inv(scale) @ moved @ scale)

    @property
    def appearance_bins(self) -> int:
        """The length of a row of the histograms."""
        return self._appearance.bins

    @property
    def height_model(self) -> HeightModel | None:
        """Expected box height by foot row, in pixels of the working image; None: not known yet."""
        return self._height_estimator.model

    def _scan_mask(self, work_image: Image, mask: Mask, shadow: Mask, grid: CellGrid) -> ForegroundScan:
        settings = self.settings
        foreground = grid.cell_shares(mask)
        empty = np.maximum(grid.weight - foreground - grid.cell_shares(shadow), 0.0)
        cost = np.asarray(settings.box_filter.background_cost * empty, dtype=np.float32)
        if self._filter is None:
            self._filter = BoxFilter(grid.weight, mask.shape[0] // CELL, settings.box_filter)
        peaks = self._filter.peaks(foreground - cost, self._heights(grid))
        fit = settings.foreground_fit
        if not self._height_estimator.is_reliable:
            fit = replace(fit, max_people=min(fit.max_people, fit.max_people_uncalibrated))
        return ForegroundScan(work_image, mask, foreground, cost, grid.weight, peaks, fit)

    def _heights(self, grid: CellGrid) -> HeightRange | None:
        """Return the possible heights in cells; the same object while the model is unchanged."""
        model, settings = self._height_estimator.model, self.settings.height_model
        if model is not self._height_model:
            self._height_model = model
            self._height_range = None
            if model is not None:
                self._height_range = HeightRange(
                    model.in_cells(CELL, grid.margin),
                    settings.tolerance,
                    settings.tolerance_std,
                    settings.min_height,
                )
        return self._height_range

    def _grid_for(self, image: Image) -> CellGrid:
        validate_image(image)
        if self._grid is None:
            self._shape = (image.shape[0], image.shape[1])
            return self._lay_grid(None)
        if image.shape[:2] != self._shape:
            raise ValueError(f"the frames' size changed from {self._shape} to {image.shape[:2]}")
        return self._grid
