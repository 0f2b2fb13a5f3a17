"""The template detector: the object is the best peak, and sub-images are compared by appearance."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from tracking.appearance import appearance_distance_matrix
from tracking.boxes import iou
from tracking.detectors import SubimageSettings, TemplateDetector, TemplateSettings
from tracking.detectors.template import subimage_histograms

Picture = npt.NDArray[np.uint8]
TOY = (120, 90, 32, 40)  # left, top, width, height


def clutter(seed: int = 0) -> Picture:
    """Draw a smooth random picture, 288x360."""
    noise = np.random.default_rng(seed).integers(0, 256, (36, 45, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(noise, (360, 288), interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


def cut(image: Picture, box: tuple[int, int, int, int] = TOY) -> Picture:
    left, top, width, height = box
    return image[top : top + height, left : left + width].copy()


def moved(image: Picture, right: int, down: int) -> Picture:
    return np.roll(image, (down, right), axis=(0, 1))


def test_the_best_peak_is_the_object() -> None:
    image = clutter()
    seen = TemplateDetector(cut(image)).detect(moved(image, 31, -12))
    np.testing.assert_array_equal(seen.boxes[0], [151, 78, 183, 118])
    assert seen.scores[0] == pytest.approx(1.0, abs=1e-4)
    assert (np.diff(seen.scores) <= 0.0).all()
    assert seen.scores[1] < 0.9


def test_a_change_of_brightness_keeps_the_peak() -> None:
    image = clutter()
    darker = cv2.convertScaleAbs(image, alpha=0.7, beta=10).astype(np.uint8)
    seen = TemplateDetector(cut(image)).detect(darker)
    assert seen.scores[0] > 0.98
    np.testing.assert_array_equal(seen.boxes[0, :2], TOY[:2])


def test_there_are_max_peaks_peaks_at_different_places() -> None:
    image = clutter()
    seen = TemplateDetector(cut(image), TemplateSettings(max_peaks=80)).detect(image)
    assert len(seen) == 80
    apart = np.abs(seen.boxes[:, None, :2] - seen.boxes[None, :, :2])
    near = (apart[..., 0] <= 2) & (apart[..., 1] <= 2)
    assert near.sum() == 80, "no peak is near another"
    assert len(TemplateDetector(cut(image), TemplateSettings(max_peaks=7)).detect(image)) == 7


def test_peaks_below_min_score_are_dropped() -> None:
    image = clutter()
    seen = TemplateDetector(cut(image), TemplateSettings(min_score=0.5)).detect(image)
    assert 1 <= len(seen) < 80
    assert (seen.scores >= 0.5).all()


@pytest.mark.parametrize("measure", ["subimage", "gray", "color"])
def test_the_object_looks_most_like_its_template(measure: str) -> None:
    image = clutter()
    detector = TemplateDetector(cut(image), TemplateSettings(appearance=measure))  # type: ignore[arg-type]
    seen = detector.detect(moved(image, 5, 5))
    assert seen.histograms.shape[1] == detector.appearance_bins
    np.testing.assert_allclose(seen.histograms.sum(axis=1), 1.0)
    away = appearance_distance_matrix(detector.histogram[None], seen.histograms)[0]
    assert int(np.argmin(away)) == 0
    assert away[0] < 0.01


def test_the_intersection_of_sub_images_is_their_mean_absolute_difference() -> None:
    image, settings = clutter(), SubimageSettings(width=32, height=40)
    boxes = np.array([[120.0, 90, 152, 130], [10, 20, 42, 60]])
    rows = subimage_histograms(image, boxes, settings)
    first, second = (cut(image, box).astype(np.float64) / 255.0 for box in (TOY, (10, 20, 32, 40)))
    distance = appearance_distance_matrix(rows[:1], rows[1:], "intersection")[0, 0]
    assert distance == pytest.approx(np.abs(first - second).mean())


def test_a_box_outside_the_picture_has_the_uniform_histogram() -> None:
    (row,) = subimage_histograms(clutter(), np.array([[400.0, 0, 420, 20]]), SubimageSettings(color=False))
    assert len(row) == SubimageSettings(color=False).length == 288
    assert np.ptp(row) == 0.0


def test_a_blank_picture_has_no_peaks() -> None:
    blank = np.full((288, 360, 3), 90, dtype=np.uint8)
    assert len(TemplateDetector(cut(clutter())).detect(blank)) == 0


def test_the_same_picture_gives_identical_peaks() -> None:
    image = clutter(3)
    one, other = (TemplateDetector(cut(image)).detect(image) for _ in range(2))
    assert one.boxes.tobytes() == other.boxes.tobytes()
    assert one.histograms.tobytes() == other.histograms.tobytes()
    assert iou(one.boxes[0], np.array([120.0, 90, 152, 130])) == 1.0


def test_an_unusable_template_is_refused() -> None:
    image = clutter()
    with pytest.raises(ValueError, match="4 pixels a side"):
        TemplateDetector(image[:3, :10])
    with pytest.raises(ValueError, match="does not fit"):
        TemplateDetector(image[:200]).detect(image[:100])
    with pytest.raises(ValueError, match="uint8"):
        TemplateDetector(image[..., 0])
    with pytest.raises(ValueError, match="max_peaks"):
        TemplateSettings(max_peaks=0)
