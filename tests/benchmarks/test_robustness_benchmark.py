"""The robustness benchmark: disturbances of small pictures, and the truth that moves with them."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.common.detection_scores import ScoredBoxes
from benchmarks.robustness import __main__ as robustness
from benchmarks.robustness.cases import Undisturbed, recovery_s
from benchmarks.robustness.disturbances.base import Disturbance, Moment
from benchmarks.robustness.disturbances.catalog import CATALOG, STRENGTHS
from benchmarks.robustness.disturbances.lens import Covered
from benchmarks.robustness.disturbances.light import Gain
from benchmarks.robustness.disturbances.motion import Knock, Sway, TurnedAway
from benchmarks.robustness.disturbances.transmission import Frozen, LowRateH264
from benchmarks.robustness.disturbed_views import Disturbed, DisturbedSource
from benchmarks.scene_runs.scores import rolling_f1
from fakes.media.videos import write_timed
from server.camera.sources import Image
from tracking.motchallenge import MotRow, format_rows

WIDTH, HEIGHT, FPS = 160, 120, 10.0
START, FRAMES = 10, 40


class Corridor:
    """Frames of a textured wall with a bright square that walks."""

    size, recorded = (WIDTH, HEIGHT), True

    def __init__(self) -> None:
        wall = np.random.default_rng(3).integers(60, 120, (HEIGHT // 8, WIDTH // 8, 3))
        self.wall = np.repeat(np.repeat(wall, 8, axis=0), 8, axis=1).astype(np.uint8)

    def take(self, pulse: int) -> Image | None:
        image = self.wall.copy()
        image[40:80, pulse : pulse + 20] = 200
        return image

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        return (image for index in indices if (image := self.take(index)) is not None)

    def close(self) -> None:
        pass


def frames_of(disturbance: Disturbance, camera: int = 0, seed: int = 1) -> list[Image | None]:
    source = DisturbedSource(Corridor, Disturbed(disturbance, START, FPS, seed, camera))
    return [source.take(pulse) for pulse in range(FRAMES)]


UNDISTURBED = frames_of(Undisturbed())


def changed(frames: list[Image | None]) -> list[int]:
    return [
        number
        for number, (frame, before) in enumerate(zip(frames, UNDISTURBED, strict=True))
        if frame is None or not np.array_equal(frame, before)
    ]


def change(frames: list[Image | None]) -> float:
    """Return the mean change of a frame in gray levels; a missing frame counts as a half of all."""
    return float(
        np.mean(
            [
                128.0 if frame is None or before is None else np.abs(frame.astype(float) - before).mean()
                for frame, before in zip(frames, UNDISTURBED, strict=True)
            ]
        )
    )


@pytest.mark.parametrize("name", CATALOG)
def test_a_disturbance_begins_at_its_frame_with_its_strength_and_is_equal_in_every_run(name: str) -> None:
    by_strength = [frames_of(CATALOG[name][strength]) for strength in STRENGTHS]
    for frames in by_strength:
        assert changed(frames)
        assert min(changed(frames)) >= START
        assert all(frame is None or frame.shape == (HEIGHT, WIDTH, 3) for frame in frames)
    if name != "turned-away":  # what comes into view may be like what was there
        changes = [change(frames) for frames in by_strength]
        assert changes == sorted(changes)
        assert changes[0] < changes[-1]
    for one, other in zip(by_strength[1], frames_of(CATALOG[name]["middle"]), strict=True):
        assert one is other if one is None or other is None else np.array_equal(one, other)


def test_a_disturbance_of_some_seconds_ends_and_one_of_one_camera_spares_the_others() -> None:
    assert changed(frames_of(Gain(factor=0.5, lasts_s=1.5))) == list(range(START, START + 15))
    assert changed(frames_of(Gain(factor=0.5, one_camera=True), camera=1)) == []


def test_what_a_turned_camera_shows_anew_stands_still_whoever_walks_at_the_margin() -> None:
    effect, wall, shown = TurnedAway(shift=0.4).begin(), Corridor().wall, []
    for frame in range(30):
        image = wall.copy()
        image[30:100, : (20 if frame % 4 == 3 else 0)] = 250
        image = np.rint(image * (1.0 if frame < 20 else 0.5)).astype(np.uint8)
        picture = effect(image, Moment(frame, frame / FPS, 1, 0))
        assert picture is not None
        shown.append(picture[:, :64].astype(float))
    for picture in shown[10:20]:
        assert np.abs(picture - shown[10]).max() <= 1.0
    assert shown[25] == pytest.approx(0.5 * shown[10], abs=2.0), "it is as dark as the rest"


def test_compressed_pictures_are_those_of_their_frames() -> None:
    effect = LowRateH264(crf=40).begin()
    for frame, level in enumerate((40, 90, 200, 120)):
        image = effect(np.full((96, 128, 3), level, dtype=np.uint8), Moment(frame, frame / FPS, 1, 0))
        assert image is not None
        assert abs(float(image.mean()) - level) < 5


def test_the_background_is_learned_before_the_disturbance() -> None:
    source = DisturbedSource(Corridor, Disturbed(Gain(factor=0.5), START, FPS, 1, 0))
    learned = list(source.prescan_images([0, 5, 15, 30]))
    assert len(learned) == 2
    assert np.array_equal(learned[1], UNDISTURBED[5])


@pytest.mark.parametrize("disturbance", [Knock(shift=0.05, degrees=2.0), Sway(amplitude=0.04)])
def test_true_boxes_move_with_the_picture(disturbance: Disturbance) -> None:
    disturbed = Disturbed(disturbance, START, FPS, 1, 0)
    truth = [MotRow(frame + 1, 7, frame, 40.0, 20.0, 40.0) for frame in range(15, FRAMES)]
    frames = frames_of(disturbance)
    moved = disturbed.truth(truth, (WIDTH, HEIGHT))
    assert [(row.frame, row.id, row.confidence) for row in moved] == [(row.frame, 7, 1.0) for row in truth]
    assert any(abs(row.left - old.left) > 3 for row, old in zip(moved, truth, strict=True))
    for row in moved:
        image = frames[row.frame - 1]
        assert image is not None
        rows, columns = np.nonzero(image.min(axis=2) > 160)
        seen = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
        np.testing.assert_allclose(row.box, seen, atol=2.5)


def test_whoever_cannot_be_seen_does_not_count() -> None:
    row = MotRow(START + 5, 7, 10.0, 40.0, 20.0, 40.0, visible=1.0)
    for disturbance in (Frozen(), Covered(share=0.5)):
        (hidden,) = Disturbed(disturbance, START, FPS, 1, 0).truth([row], (WIDTH, HEIGHT))
        assert (hidden.confidence, round(hidden.visible, 2)) == (0.0, 0.0)
    beside = MotRow(START + 5, 7, 130.0, 40.0, 20.0, 40.0, visible=1.0)
    truth = [beside, row, replace(beside, frame=START), replace(row, frame=START)]
    seen = Disturbed(Covered(share=0.5), START, FPS, 1, 0).truth(truth, (WIDTH, HEIGHT))
    assert [other.confidence for other in seen] == [1.0, 0.0, 1.0, 1.0]


def test_recovery_is_when_the_score_stays_as_good_as_undisturbed() -> None:
    before = np.full(50, 0.9)
    for bad, seconds in (([], 0.0), ([3, 4, 9], 1.0), ([49], float("inf"))):
        after = before.copy()
        after[bad] = 0.5
        assert recovery_s(after, before, FPS) == seconds


def test_the_rolling_score_counts_boxes_of_all_cameras() -> None:
    truth = [MotRow(frame, 1, 10, 10, 20, 40) for frame in range(1, 11)]
    tracks = [row for row in truth if row.frame > 5]
    scores = rolling_f1({"c0": truth, "c1": truth}, {"c0": tracks, "c1": truth}, 12, 2)
    assert scores[0] == pytest.approx(2 * 2 / (4 + 2))
    assert scores[5:].tolist() == [1.0] * 6


def test_average_precision_and_calibration_of_scored_boxes() -> None:
    truth = [MotRow(1, 1, 0, 0, 10, 20), MotRow(1, 2, 50, 0, 10, 20), MotRow(2, 1, 0, 0, 10, 20)]
    boxes = [
        MotRow(1, -1, 0, 0, 10, 20, 0.9),
        MotRow(1, -1, 1, 0, 10, 20, 0.8),
        MotRow(1, -1, 50, 0, 10, 20, 0.7),
        MotRow(2, -1, 90, 0, 10, 20, 0.2),
    ]
    scored = ScoredBoxes.of(truth, boxes)
    assert scored.right.tolist() == [True, False, True, False]
    assert scored.average_precision == pytest.approx((1 + 2 / 3) / 3)
    assert (scored.recall(0.75), scored.precision(0.75)) == (pytest.approx(1 / 3), 0.5)
    assert scored.calibration_error == pytest.approx((0.1 + 0.8 + 0.3 + 0.2) / 4)
    ignored = [*truth[:2], MotRow(2, 1, 90, 0, 10, 20, 0.0)]
    assert len(ScoredBoxes.of(ignored, boxes).scores) == 3
    assert ScoredBoxes.joined([scored, scored]).average_precision == pytest.approx(5 / 9)


def test_a_recording_is_run_with_and_without_a_disturbance(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "pets09"
    (folder / "gt").mkdir(parents=True)
    images = [image for image in UNDISTURBED if image is not None]
    write_timed(folder / "c0.mp4", [number / 25 for number in range(FRAMES)], pictures=images)
    truth = [MotRow(frame + 1, 7, frame, 40.0, 20.0, 40.0) for frame in range(FRAMES)]
    (folder / "gt" / "c0.txt").write_text(format_rows(truth), encoding="ascii")
    command = ["robustness", "--data", str(tmp_path), "--out", str(tmp_path / "out"), "--scene", "terrace"]
    command += ["--scene", "pets09", "--disturbance", "covered", "--strength", "strong", "--start", "20"]
    monkeypatch.setattr(sys, "argv", command)
    robustness.main()
    text = (tmp_path / "out" / "robustness.txt").read_text(encoding="utf-8")
    assert "terrace: skipped" in text
    assert "pets09, background: 40 frames, disturbed from 20 on" in text
    assert "covered strong" in text
    assert (tmp_path / "out" / "robustness.png").exists()
