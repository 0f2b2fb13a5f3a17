"""The template tracker: two toys that cross keep their ids, and the occluded one is hidden."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from fakes.tracking.windows import window_of_frames
from tracking import PAPER_COSTS, CostSettings, TemplateTracker, WindowSettings, create_solver
from tracking.boxes import iou
from tracking.detectors import TemplateSettings
from tracking.window import WindowResult

FRAMES = 30
SIZE = 28
Picture = npt.NDArray[np.uint8]


def texture(seed: int, width: int, height: int) -> Picture:
    rng = np.random.default_rng(seed)
    coarse = rng.integers(0, 256, (height // 7, width // 7, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


GROUND, TOYS = texture(0, 210, 140), (texture(1, SIZE, SIZE), texture(2, SIZE, SIZE))


def places(frame: int) -> npt.NDArray[np.float64]:
    """Return the boxes of two toys that cross: the first moves right, in front of the second."""
    lefts = np.array([20.0 + 4 * frame, 150.0 - 4 * frame])
    return np.stack([lefts, np.full(2, 50.0), lefts + SIZE, np.full(2, 50.0 + SIZE)], axis=1)


def picture(frame: int) -> Picture:
    canvas = GROUND.copy()
    for toy in (1, 0):
        left = int(places(frame)[toy, 0])
        canvas[50 : 50 + SIZE, left : left + SIZE] = TOYS[toy]
    return canvas


def tracker(stride: int = 5) -> TemplateTracker:
    costs = replace(PAPER_COSTS, confidence=1.0)
    window = window_of_frames(15, stride)
    settings = TemplateSettings(max_peaks=30)
    return TemplateTracker(picture(0), places(0), settings, window, costs, create_solver("columns"))


def final(results: list[WindowResult | None]) -> dict[int, dict[int, npt.NDArray[np.float64]]]:
    """Return the final boxes by object and frame."""
    rows: dict[int, dict[int, npt.NDArray[np.float64]]] = {1: {}, 2: {}}
    for result in results:
        for track in result.tracks if result else ():
            for frame in range(result.first, result.final_to + 1):  # type: ignore[union-attr]
                box = track.boxes[frame - result.first]  # type: ignore[union-attr]
                if not np.isnan(box).any():
                    assert frame not in rows[track.id], "a frame became final twice"
                    rows[track.id][frame] = box
    return rows


def test_toys_that_cross_keep_their_ids() -> None:
    one = tracker()
    rows = final([*(one.push(picture(frame)) for frame in range(1, FRAMES)), one.flush()])
    assert sorted(rows[1]) == list(range(1, FRAMES)), "the one in front is never hidden"
    for frame in range(1, FRAMES):
        assert iou(rows[1][frame], places(frame)[0]) > 0.8
        if frame in rows[2]:
            assert iou(rows[2][frame], places(frame)[1]) > 0.6, frame
    assert 15 not in rows[2] and 16 not in rows[2], "hidden behind the other"  # noqa: PT018
    assert len(rows[2]) >= 20


def test_windows_end_at_the_stride_and_flush_ends_the_last_one() -> None:
    one = tracker(stride=10)
    ends = [frame for frame in range(1, 24) if one.push(picture(frame))]
    assert ends == [9, 19]
    last = one.flush()
    assert last is not None
    assert (last.last, last.final_to) == (23, 23)
    assert one.flush() is None


def test_templates_are_boxes() -> None:
    costs, window = CostSettings(), WindowSettings()
    for boxes in (np.empty((0, 4)), np.zeros(4), np.zeros((2, 3))):
        with pytest.raises(ValueError, match=r"boxes \(n, 4\)"):
            TemplateTracker(picture(0), boxes, TemplateSettings(), window, costs, create_solver("columns"))
