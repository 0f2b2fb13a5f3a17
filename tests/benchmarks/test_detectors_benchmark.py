"""The detector benchmark on hand-made boxes and pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.common.detector_names import detector_settings
from benchmarks.common.environment import CannotRunError
from benchmarks.detectors.compared_detectors import BlobDetector, compared_detectors, rows_of
from benchmarks.detectors.score_calibration import Platt, fit_platt
from benchmarks.detectors.scored_views import ScoredView, oracle, scores_of_boxes, scores_of_tracks, views_of
from server.models.catalog import MODELS
from tracking.motchallenge import MotRow

TRUTH = [MotRow(1, 7, 10, 10, 20, 50), MotRow(1, 8, 100, 10, 20, 50), MotRow(2, 7, 12, 10, 20, 50)]
FOUND = [MotRow(1, -1, 11, 10, 20, 50), MotRow(1, -1, 11, 12, 20, 50), MotRow(2, -1, 200, 10, 20, 50)]


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
    detector = BlobDetector(())
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


def test_detectors_without_a_network_are_compared_and_find_nothing_in_an_empty_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MYVIEW_MODELS", str(tmp_path))
    compared = compared_detectors()
    assert {spec.detect["kind"] for spec in compared if spec.detect} == {"background", "boxes", "hog"}
    view = ScoredView({"id": "c0", "source": "none.mp4", "ignore": [[[0, 0], [9, 0], [9, 9]]]}, None, 0.3)
    empty = np.full((120, 160, 3), 90, dtype=np.uint8)
    for spec in compared:
        assert len(spec.make(view, (160, 120)).detect(empty)) == 0


def test_installed_networks_are_compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MYVIEW_MODELS", str(tmp_path))
    (tmp_path / f"{MODELS[0].name}.onnx").touch()
    network = {"onnx": {"model": MODELS[0].name}}
    compared = [spec.detect for spec in compared_detectors()]
    assert {"kind": "onnx", **network} in compared
    assert {"kind": "fused", **network} in compared
    assert detector_settings(f"fused+{MODELS[0].name}") == {"kind": "fused", **network}


def test_the_fit_of_a_calibration_finds_the_constants_that_made_the_scores() -> None:
    random = np.random.default_rng(1)
    truth = Platt(3.0, 1.2)
    logits = random.normal(-0.5, 1.0, 20_000)
    probabilities = truth.probabilities(logits)
    fitted = fit_platt(logits, random.random(len(logits)) < probabilities)
    assert (fitted.slope, fitted.offset) == pytest.approx((3.0, 1.2), abs=0.1)
    np.testing.assert_allclose(truth.logits(probabilities), logits, atol=0.1)


def test_a_missing_scene_is_named(tmp_path: Path) -> None:
    with pytest.raises(CannotRunError, match="needs the recordings"):
        views_of(tmp_path, "terrace")
