"""The detector benchmark on hand-made boxes and pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.common.environment import CannotRunError
from benchmarks.detectors.compared_detectors import BlobDetector, rows_of
from benchmarks.detectors.scored_views import ScoredView, oracle, scores_of_boxes, scores_of_tracks, views_of
from tracking.motchallenge import MotRow

TRUTH = [MotRow(1, 7, 10, 10, 20, 50), MotRow(1, 8, 100, 10, 20, 50), MotRow(2, 7, 12, 10, 20, 50)]
FOUND = [MotRow(1, -1, 11, 10, 20, 50), MotRow(1, -1, 11, 12, 20, 50), MotRow(2, -1, 200, 10, 20, 50)]
VIEW = ScoredView("c0", Path("c0.mp4"), None, watermark=False, min_height=0.2)


def test_a_person_matches_one_box_per_frame() -> None:
    scores = scores_of_boxes(TRUTH, FOUND)
    assert (scores.recall, scores.precision) == pytest.approx((1 / 3, 1 / 3))
    assert scores.idf1 == pytest.approx(2 / 4)


def test_the_oracle_ignores_false_positives() -> None:
    assert oracle({"c0": TRUTH}, {"c0": FOUND}) == pytest.approx(2 / 4)
    assert oracle({"c0": TRUTH, "c1": TRUTH}, {"c0": TRUTH, "c1": []}) == pytest.approx(2 * 3 / (6 + 3))


def test_the_true_tracks_have_perfect_scores() -> None:
    scores = scores_of_tracks(TRUTH, TRUTH)
    assert (scores.recall, scores.precision, scores.idf1) == pytest.approx((1, 1, 1))


def test_blobs_are_boxes_of_moving_objects() -> None:
    detector = BlobDetector(VIEW)
    found = None
    for frame in range(60):
        image = np.full((120, 160, 3), 90, dtype=np.uint8)
        if frame >= 40:
            image[30:90, 2 * frame - 60 : 2 * frame - 35] = 200
        found = detector.detect(image)
    assert found is not None
    (row,) = rows_of(59, found)
    assert row.frame == 60
    np.testing.assert_allclose(row.box, (58, 30, 83, 90), atol=4)


def test_a_missing_scene_is_named(tmp_path: Path) -> None:
    with pytest.raises(CannotRunError, match="needs the recordings"):
        views_of(tmp_path, "terrace")
