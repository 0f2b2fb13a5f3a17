"""The HOG detector: boxes on people, best first, without duplicates."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from synthetic import Scene
from tracking.boxes import iou
from tracking.detectors import AppearanceExtractor, AppearanceSettings, HogDetector, HogSettings
from tracking.detectors.non_maximum_suppression import non_maximum_suppression
from tracking.types import Detections

SETTINGS = HogSettings(min_height=0.25)
FRAME = 110


@cache
def room() -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float64]]:
    """Return a picture of the synthetic room and the boxes of fully visible people."""
    scene = Scene("room", 3, 4, 1, 640, 360, 25)
    seen = scene.truth(FRAME)[0]
    return scene.image(0, FRAME), seen.boxes[seen.visibility >= 0.8]


def found(settings: HogSettings = SETTINGS) -> Detections:
    return HogDetector(settings).detect(room()[0])


def test_people_are_detected_in_boxes_of_their_size() -> None:
    overlaps = iou(found().boxes[:, None], room()[1][None]).max(axis=0)
    assert np.count_nonzero(overlaps >= 0.6) >= 2, overlaps


def test_scores_are_sorted_and_no_person_is_detected_twice() -> None:
    seen = found()
    assert (np.diff(seen.scores) <= 0.0).all()
    assert ((seen.scores >= 0.5) & (seen.scores <= 1.0)).all()
    overlaps = iou(seen.boxes[:, None], seen.boxes[None])
    assert (overlaps[~np.eye(len(seen), dtype=np.bool_)] <= SETTINGS.nms_iou).all()


def test_histograms_follow_the_settings() -> None:
    detector = HogDetector(SETTINGS, AppearanceExtractor(AppearanceSettings(color=False), 32))
    seen = detector.detect(room()[0])
    assert detector.appearance_bins == 32 == seen.histograms.shape[1]
    np.testing.assert_allclose(seen.histograms.sum(axis=1), 1.0)


def test_ignored_regions_have_no_detections() -> None:
    everything = (((0.0, 0.0), (640.0, 0.0), (640.0, 360.0), (0.0, 360.0)),)
    assert len(HogDetector(SETTINGS, ignore=everything).detect(room()[0])) == 0


def test_the_same_picture_gives_identical_boxes() -> None:
    assert found().boxes.tobytes() == found().boxes.tobytes()


def test_of_equal_boxes_the_first_by_position_is_kept_in_any_order() -> None:
    boxes = np.array([[10.0, 0, 20, 30], [11.0, 0, 21, 30], [50.0, 0, 60, 30], [9.0, 0, 19, 30]])
    scores = np.array([0.5, 0.5, 0.9, 0.5])
    for order in ([0, 1, 2, 3], [3, 2, 1, 0], [1, 3, 0, 2]):
        kept = non_maximum_suppression(boxes[order], scores[order], 0.5, 10)
        np.testing.assert_array_equal(boxes[order][kept], [[50, 0, 60, 30], [9, 0, 19, 30]])
    assert len(non_maximum_suppression(boxes, scores, 0.5, 1)) == 1
    assert len(non_maximum_suppression(boxes[:0], scores[:0], 0.5, 1)) == 0


def test_invalid_settings_are_refused() -> None:
    with pytest.raises(ValueError, match="min_height"):
        HogSettings(min_height=0.0)
    with pytest.raises(ValueError, match="step"):
        HogSettings(scale_step=1.0)
