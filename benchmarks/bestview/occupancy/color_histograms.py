"""What everybody on a path looks like, in every frame of a camera, where nobody else covers them."""

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
"""Of so many frames one is looked at."""
_BINS = AppearanceSettings().color_bins


def looks_of(
    config: Config, camera: str, masks: ForegroundMasks, firsts: Sequence[int], boxes: Sequence[Floats]
) -> tuple[list[NDArray[np.float32]], list[NDArray[np.float32]]]:
    """Look at a recording again; give each path's looks (F, B), and of how many pixels they are (F,).

    Args:
        config: the site.
        camera: whose recording it is.
        masks: the foreground in it.
        firsts: each path's first frame.
        boxes: each path's boxes (F, 4) in pixels of the camera's picture, NaN where it has none.
    """
    looks = [np.zeros((len(it), AppearanceSettings().length), dtype=np.float32) for it in boxes]
    pixels = [np.zeros(len(it), dtype=np.float32) for it in boxes]
    pipeline = CameraPipeline(config, camera)
    for frame in range(len(masks.foreground)):
        try:
            image = pipeline.take(frame)
        except SourceEndedError:
            break
        foreground = masks.foreground[frame]
        if image is None or foreground is None or frame % _EVERY:
            continue
        there = [it for it, first in enumerate(firsts) if 0 <= frame - first < len(boxes[it])]
        there = [it for it in there if np.isfinite(boxes[it][frame - firsts[it]]).all()]
        here = np.array([boxes[it][frame - firsts[it]] for it in there]).reshape(-1, 4)
        mask = _alone(foreground, image.shape[:2], here)
        for it, row, count in zip(
            there, color_histograms(image, here, _BINS, mask), _sums(mask, here), strict=True
        ):
            looks[it][frame - firsts[it]] = row
            pixels[it][frame - firsts[it]] = count
    pipeline.close()
    return looks, pixels


def _slices(box: Floats, shape: tuple[int, ...]) -> tuple[slice, slice]:
    left, top, right, bottom = np.rint(np.clip(box, 0.0, [shape[1], shape[0]] * 2)).astype(np.int64).tolist()
    return slice(top, bottom), slice(left, right)


def _alone(foreground: NDArray[np.uint8], shape: tuple[int, ...], boxes: Floats) -> NDArray[np.uint8]:
    """Return the foreground in the picture (H, W), 255 or 0, where no more than one box is."""
    size = (shape[1], shape[0])
    whole = cv2.resize(foreground, size, interpolation=cv2.INTER_NEAREST)
    covered = np.zeros(shape, dtype=np.uint8)
    for box in boxes:
        covered[_slices(box, shape)] += 1
    return np.where((whole > 127) & (covered <= 1), np.uint8(255), np.uint8(0))


def _sums(mask: NDArray[np.uint8], boxes: Floats) -> list[int]:
    return [int(np.count_nonzero(mask[_slices(box, mask.shape)])) for box in boxes]
