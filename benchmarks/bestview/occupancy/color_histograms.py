"""Color histograms of the unoccluded parts of people on paths, in each frame of a camera."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.bestview.occupancy.foreground_masks import ForegroundMasks
from server.camera.pipeline import CameraPipeline
from server.camera.sources import SourceEndedError
from server.config.site_config import Config
from tracking.boxes import Floats
from tracking.detectors.color_histogram import AppearanceSettings, color_histograms

_EVERY = 2
"""One frame in so many is used."""
_BINS = AppearanceSettings().color_bins


def path_histograms(
    config: Config, camera: str, masks: ForegroundMasks, firsts: Sequence[int], boxes: Sequence[Floats]
) -> tuple[list[NDArray[np.float32]], list[NDArray[np.float32]]]:
    """Compute each path's histograms (F, B) and their pixel counts (F,) from a recording.

    Args:
        config: the site.
        camera: of the recording.
        masks: its foreground.
        firsts: each path's first frame.
        boxes: each path's boxes (F, 4) in pixels of the camera's picture, NaN where it has none.
    """
    histograms = [np.zeros((len(box), AppearanceSettings().color_length), dtype=np.float32) for box in boxes]
    pixels = [np.zeros(len(box), dtype=np.float32) for box in boxes]
    pipeline = CameraPipeline(config, camera)
    for frame in range(len(masks.foreground)):
        try:
            captured = pipeline.take(frame)
        except SourceEndedError:
            break
        image = None if captured is None else captured.image
        foreground = masks.foreground[frame]
        if image is None or foreground is None or frame % _EVERY:
            continue
        present = [track for track, first in enumerate(firsts) if 0 <= frame - first < len(boxes[track])]
        present = [track for track in present if np.isfinite(boxes[track][frame - firsts[track]]).all()]
        present_boxes = np.array([boxes[track][frame - firsts[track]] for track in present]).reshape(-1, 4)
        mask = _unoccluded(foreground, image.shape[:2], present_boxes)
        for track, row, count in zip(
            present,
            color_histograms(image, present_boxes, _BINS, mask),
            _sums(mask, present_boxes),
            strict=True,
        ):
            histograms[track][frame - firsts[track]] = row
            pixels[track][frame - firsts[track]] = count
    pipeline.close()
    return histograms, pixels


def _slices(box: Floats, shape: tuple[int, ...]) -> tuple[slice, slice]:
    left, top, right, bottom = np.rint(np.clip(box, 0.0, [shape[1], shape[0]] * 2)).astype(np.int64).tolist()
    return slice(top, bottom), slice(left, right)


def _unoccluded(foreground: NDArray[np.uint8], shape: tuple[int, ...], boxes: Floats) -> NDArray[np.uint8]:
    """Return the foreground (H, W), 255 or 0, of the pixels in at most one box."""
    size = (shape[1], shape[0])
    whole = cv2.resize(foreground, size, interpolation=cv2.INTER_NEAREST)
    covered = np.zeros(shape, dtype=np.uint8)
    for box in boxes:
        covered[_slices(box, shape)] += 1
    return np.where((whole > 127) & (covered <= 1), np.uint8(255), np.uint8(0))


def _sums(mask: NDArray[np.uint8], boxes: Floats) -> list[int]:
    return [int(np.count_nonzero(mask[_slices(box, mask.shape)])) for box in boxes]
