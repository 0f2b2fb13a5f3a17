"""The MOT file detector: the right frame, scores in [0, 1], no duplicates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tracking.detectors import MotFileDetector, MotFileSettings

NOTHING = np.empty((0, 0, 3), dtype=np.uint8)
ROWS = """\
1,-1,10,20,30,60,50,-1,-1,-1
1,-1,11,20,30,60,40,-1,-1,-1
1,-1,200,20,30,60,-10,-1,-1,-1
3,-1,12,20,30,60,20,-1,-1,-1
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "det.txt"
    path.write_text(ROWS, encoding="utf-8")
    return path


def test_frames_come_in_order_and_those_without_a_row_are_empty(file: Path) -> None:
    detector = MotFileDetector(file)
    assert [len(detector.detect(NOTHING)) for _ in range(4)] == [2, 0, 1, 0]
    assert detector.last_frame == 2


def test_a_frame_can_be_selected_by_number(file: Path) -> None:
    detector = MotFileDetector(file, MotFileSettings(first_frame=100))
    np.testing.assert_array_equal(detector.detect(NOTHING, 102).boxes, [[12, 20, 42, 80]])
    assert len(detector.detect(NOTHING)) == 0
    assert len(detector.detect(NOTHING, 99)) == 0


def test_confidences_are_scaled_to_scores_and_duplicates_are_removed(file: Path) -> None:
    seen = MotFileDetector(file).detect(NOTHING)
    np.testing.assert_allclose(seen.scores, [1.0, 0.0])
    np.testing.assert_array_equal(seen.boxes[:, 0], [10, 200])
    both = MotFileDetector(file, MotFileSettings(nms_iou=0.99)).detect(NOTHING)
    np.testing.assert_allclose(both.scores, [1.0, 5 / 6, 0.0])
    assert len(MotFileDetector(file, MotFileSettings(min_score=0.5)).detect(NOTHING)) == 1


def test_one_outlier_confidence_does_not_lower_the_other_scores(tmp_path: Path) -> None:
    path = tmp_path / "det.txt"
    confidences = [10.0, *(20.0 + n / 10 for n in range(18)), 1000.0]
    path.write_text("".join(f"{n + 1},-1,0,0,30,60,{c},-1,-1,-1\n" for n, c in enumerate(confidences)))
    detector = MotFileDetector(path)
    scores = [float(detector.detect(NOTHING).scores[0]) for _ in confidences]
    assert scores[0] == 0.0
    assert scores[-1] == 1.0
    assert min(scores[1:]) > 0.8


def test_appearance_comes_from_the_picture_where_there_is_one(file: Path) -> None:
    assert MotFileDetector(file).detect(NOTHING).histograms.shape == (2, 0)
    picture = np.full((100, 300, 3), 128, dtype=np.uint8)
    histograms = MotFileDetector(file).detect(picture).histograms
    assert histograms.shape == (2, 64)
    np.testing.assert_allclose(histograms[:, 32], 1.0)


def test_a_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="none"):
        MotFileDetector(tmp_path / "none.txt")
