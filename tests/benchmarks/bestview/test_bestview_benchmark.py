"""The best-view benchmark: baselines and ground-truth stages on simple boxes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.bestview import __main__ as bestview
from benchmarks.bestview.association_baselines import (
    apart_by_floor,
    boxes_by_truth,
    by_nearest_feet,
    interpolated_gaps,
    own_tracks,
    tracks_by_truth,
    unassociated_tracks,
)
from benchmarks.bestview.camera_tracks import Rows
from benchmarks.bestview.methods import MethodResult, score_method, visible_rows
from benchmarks.bestview.parameter_sweep import DEFAULT_SWITCH_COST_S, STRIDE, SweepSetting, sweep
from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.bestview.service_decisions import Rendering, decide_with_true_ids, largest
from benchmarks.bestview.visibility_losses import VisibilityLosses, losses
from server.cli.evaluate.choices_file import Choice
from server.messaging.messages import CameraTracks, TrackMessage
from server.messaging.packed_arrays import pack_boxes
from tracking.motchallenge import MotRow

FRAMES = 60
NEAR, FAR = (10.0, 10.0, 40.0, 60.0), (60.0, 20.0, 10.0, 20.0)
GROUND = {"c0": np.eye(3), "c1": np.array([[1.0, 0.0, 100.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])}


def rows(identity: int, left: float, frames: Sequence[int], top: float = 0.0) -> list[MotRow]:
    return [MotRow(frame, identity, left, top, 10.0, 20.0) for frame in frames]


def hall(gt: Rows, min_visible: float = 0.25) -> BenchmarkScene:
    content = {
        "site": {"name": "hall", "fps": 10.0, "width": 100, "height": 100},
        "encode": {"gop_s": 0.5},
        "cameras": [{"id": camera, "source": "scene:none"} for camera in gt],
    }
    return BenchmarkScene("hall", "two views", content, gt, min_visible)


@pytest.fixture
def passing() -> BenchmarkScene:
    """Somebody is near c0 for the first half and near c1 for the second; both always see them."""
    first, second = range(1, FRAMES // 2 + 1), range(FRAMES // 2 + 1, FRAMES + 1)
    return hall(
        {
            "c0": [MotRow(frame, 5, *NEAR) for frame in first] + [MotRow(frame, 5, *FAR) for frame in second],
            "c1": [MotRow(frame, 5, *FAR) for frame in first] + [MotRow(frame, 5, *NEAR) for frame in second],
        }
    )


def test_on_true_boxes_myviews_choice_is_the_optimum_where_it_is_plain(passing: BenchmarkScene) -> None:
    truth = passing.truth()
    for found in (
        decide_with_true_ids(passing.config(), passing.gt, FRAMES),
        decide_with_true_ids(passing.config(), visible_rows(passing, truth), FRAMES),
    ):
        score = score_method(passing, truth, MethodResult("true", found, ground_truth=True)).views
        assert (score.agreement, score.regret, score.visible, score.chosen) == (1.0, 0.0, 1.0, 1.0)
        assert score.cuts_per_minute == score.optimum_cuts_per_minute == 10.0


def test_the_largest_box_is_taken_frame_by_frame(passing: BenchmarkScene) -> None:
    shown = largest(passing.gt, passing.sizes, FRAMES)
    assert shown[:2] == [Choice(1, 5, "c0"), Choice(2, 5, "c0")]
    assert {choice.camera for choice in shown[FRAMES // 2 :]} == {"c1"}
    assert largest({"c0": [], "c1": []}, passing.sizes, FRAMES) == []


def test_who_is_hidden_is_not_among_the_true_boxes() -> None:
    scene = hall({"c0": [MotRow(1, 1, *NEAR, visible=0.1), MotRow(2, 1, *NEAR, visible=0.9)], "c1": []})
    assert [row.frame for row in visible_rows(scene, scene.truth())["c0"]] == [2]


def test_whole_tracks_are_joined_by_their_feet() -> None:
    tracks = {
        "c0": [*rows(1, 105.0, range(1, 20)), *rows(2, 150.0, range(1, 20))],
        "c1": [*rows(1, 52.0, range(1, 20)), *rows(2, 7.0, range(1, 20)), *rows(3, 7.0, range(1, 4))],
    }
    joined = by_nearest_feet(tracks, GROUND)
    identity = {camera: {row.left: row.id for row in reversed(found)} for camera, found in joined.items()}
    assert identity["c0"][105.0] == identity["c1"][7.0]
    assert identity["c0"][150.0] == identity["c1"][52.0]
    assert len({row.id for found in joined.values() for row in found}) == 3, "the short one stays alone"


def test_two_tracks_of_one_camera_are_never_joined_while_both_are_there() -> None:
    tracks = {
        "c0": rows(1, 100.0, range(1, 20)),
        "c1": [*rows(1, 0.0, range(1, 20)), *rows(2, 1.0, range(10, 20)), *rows(3, 2.0, range(30, 40))],
    }
    joined = by_nearest_feet(tracks, GROUND)
    assert len({row.id for row in joined["c1"]}) == 3
    assert joined["c0"][0].id == joined["c1"][0].id


def test_nobody_is_joined_where_nobody_shares_a_frame() -> None:
    tracks = {"c0": rows(1, 100.0, range(1, 20)), "c1": rows(1, 0.0, range(30, 40))}
    joined = by_nearest_feet(tracks, GROUND)
    assert joined["c0"][0].id != joined["c1"][0].id
    assert joined == unassociated_tracks(tracks)


def test_the_truth_may_name_boxes_or_whole_tracks() -> None:
    gt = {"c0": [*rows(7, 0.0, range(1, 11)), *rows(8, 50.0, range(1, 11))]}
    swapped = {"c0": [*rows(1, 0.0, range(1, 8)), *rows(1, 50.0, range(8, 11)), *rows(2, 80.0, range(1, 3))]}
    assert [(row.frame, row.id) for row in boxes_by_truth(swapped, gt)["c0"]] == [
        (frame, 7 if frame < 8 else 8) for frame in range(1, 11)
    ]
    assert {row.id for row in tracks_by_truth(swapped, gt)["c0"]} == {7}
    assert len(tracks_by_truth(swapped, gt)["c0"]) == 10


def test_only_cameras_of_one_floor_share_ids() -> None:
    everywhere = {camera: rows(7, 0.0, range(1, 4)) for camera in ("c0", "c1", "c2", "c3")}
    apart = apart_by_floor(everywhere, ("c0", "c2"))
    ids = {camera: {row.id for row in found} for camera, found in apart.items()}
    assert ids["c0"] == ids["c2"]
    assert len(set.union(*ids.values())) == 3
    assert [row.left for row in apart["c3"]] == [0.0] * 3


def test_moments_of_hiding_are_bridged_and_absences_are_not() -> None:
    tracks = {"c0": [*rows(1, 0.0, [1, 2]), *rows(1, 4.0, [6]), *rows(1, 9.0, [20]), *rows(2, 50.0, [1])]}
    found = [(row.frame, row.left) for row in interpolated_gaps(tracks, 4)["c0"] if row.id == 1]
    assert found == [(1, 0.0), (2, 0.0), (3, 1.0), (4, 2.0), (5, 3.0), (6, 4.0), (20, 9.0)]


def test_of_two_tracks_at_one_person_the_longer_stays() -> None:
    gt = {"c0": rows(7, 0.0, range(1, 11))}
    double = {"c0": [*rows(2, 1.0, range(4, 7)), *rows(3, 0.0, range(1, 11))]}
    assert [row.left for row in tracks_by_truth(double, gt)["c0"]] == [0.0] * 10


def test_a_cameras_own_tracks_are_what_was_final() -> None:
    def message(first: int, last: int, final_to: int, left: float, *, ended: bool = False) -> CameraTracks:
        boxes = [(left, 0.0, left + 10.0, 20.0)] * (last - first + 1)
        return CameraTracks(
            camera="c0",
            boot=0,
            size=(100, 100),
            epoch=last // 5,
            first=first,
            last=last,
            final_to=final_to,
            ended=ended,
            shed=[],
            tracks=[TrackMessage(id=3, boxes=pack_boxes(boxes), confidence=1.0)],
            solve=None,
        )

    found = own_tracks(
        {"c0": [message(0, 9, 4, 1.0), message(5, 14, 9, 2.0), message(10, 16, 16, 3.0, ended=True)]}
    )
    assert [row.frame for row in found["c0"]] == list(range(1, 18))
    assert [row.left for row in found["c0"]] == [1.0] * 5 + [2.0] * 5 + [3.0] * 7


def test_what_keeps_somebody_from_being_seen_is_told_apart(passing: BenchmarkScene) -> None:
    truth = passing.truth()
    found = {
        "c0": [replace(row, id=1 if row.frame <= 20 else 2) for row in passing.gt["c0"] if row.frame <= 30],
        "c1": [],
    }
    shown = [Choice(frame, 1, "c0") for frame in range(1, 11)]
    shares = losses(passing, truth, MethodResult("ours", Rendering(found, shown)))
    assert shares == VisibilityLosses(visible=10 / 60, selection=10 / 60, identity=10 / 60, detection=30 / 60)


def test_settings_are_swept_and_knowing_all_costs_nothing_but_the_gop(passing: BenchmarkScene) -> None:
    found = {score.setting: score for score in sweep(passing, passing.truth(), quick=True)}
    assert found[SweepSetting(None, 1, DEFAULT_SWITCH_COST_S)].score.regret == 0.0
    assert found[SweepSetting(25, 10, DEFAULT_SWITCH_COST_S)].delay_s == (25 + STRIDE - 2) / 10.0
    assert all(score.score.regret >= 0.0 for score in found.values())


@pytest.mark.slow
def test_the_benchmark_prints_a_row_for_every_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bestview, "QUICK_ROOMS", ((2, 1, 1.0),))
    out = tmp_path / "out"
    monkeypatch.setattr(sys, "argv", ["x", "--quick", "--out", str(out), "--data", str(tmp_path)])
    bestview.main()
    printed = (out / "bestview.txt").read_text(encoding="utf-8")
    assert "terrace: skipped: needs the recordings" in printed
    ours, others = ("own boxes, true ids", "MyView", "no homographies"), ("nearest feet", "occupancy map")
    for method in ("true boxes, largest", *ours, *others):
        assert method in printed
    assert (out / "bestview.png").stat().st_size > 1000
    assert (out / "bestview_sweeps.png").stat().st_size > 1000
