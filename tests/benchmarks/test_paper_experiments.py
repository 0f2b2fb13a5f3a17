"""The paper's experiments on scenes of a few frames: simulation, label errors and tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.common.report import Report
from benchmarks.paper_experiments import __main__ as paper_experiments
from benchmarks.paper_experiments.__main__ import attempt, row, run
from benchmarks.paper_experiments.drawn_toys import TOYS, play_toys
from benchmarks.paper_experiments.experiment_list import EXPERIMENTS, Experiment, PaperFigure, TrackerSetting
from benchmarks.paper_experiments.label_errors import judge, named, per_frame
from benchmarks.paper_experiments.noisy_detections import SceneParameters, play
from benchmarks.paper_experiments.scene import ExperimentScene, ObjectTruth
from benchmarks.paper_experiments.walking_people import WalkParameters
from benchmarks.paper_experiments.windowed_tracking import follow
from fakes.tracking.windows import window_of_frames
from tracking import (
    PAPER,
    PAPER_COSTS,
    CostSettings,
    Detections,
    SolverBudget,
    Template,
    WindowSettings,
    create_solver,
)
from tracking.boxes import iou

FRAMES = 40
CAST = SceneParameters((0, 1), FRAMES, WalkParameters(3.0, 0.15))


def box(left: float) -> list[float]:
    return [left, 0.0, left + 40.0, 100.0]


def two_apart(kits: tuple[int, ...] = (0, 1)) -> ExperimentScene:
    """Two people who stand apart for four frames, both found in each."""
    boxes = np.array([[box(0.0)] * 4, [box(200.0)] * 4])
    frame = Detections(boxes[:, 0], np.ones(2), np.eye(2))
    templates = tuple(Template(k + 1, np.eye(2)[k], boxes[k, 0]) for k in range(2))
    return ExperimentScene(ObjectTruth(boxes, np.ones((2, 4))), ((frame,) * 4,), templates, kits)


def test_a_scene_is_the_same_for_the_same_seed() -> None:
    once, again, other = play(CAST, 1), play(CAST, 1), play(CAST, 2)
    np.testing.assert_array_equal(once.truth.boxes, again.truth.boxes)
    np.testing.assert_array_equal(once.seen[0][9].histograms, again.seen[0][9].histograms)
    assert not np.array_equal(once.truth.boxes, other.truth.boxes)


def test_who_leaves_is_away_and_comes_back() -> None:
    cast = replace(CAST, frames=400, walking=WalkParameters(6.0, 0.2, stay=(20, 40), away=(10, 20)))
    away = np.isnan(play(cast, 1).truth.boxes[0, :, 0])
    leaves, returns = (
        np.flatnonzero(np.diff(away.astype(int)) == 1),
        np.flatnonzero(np.diff(away.astype(int)) == -1),
    )
    assert len(leaves) > 1
    assert len(returns) > 1
    assert returns[0] > leaves[0]


def test_labels_on_their_own_objects_are_right() -> None:
    scene = two_apart()
    labels = judge(scene, scene.truth.boxes)
    assert per_frame(labels.wrong) == 0.0
    assert per_frame(labels.missing) == 0.0


def test_exchanged_labels_are_wrong_and_in_one_kit_alike() -> None:
    for kits, unlike in (((0, 1), 2.0), ((0, 0), 0.0)):
        scene = two_apart(kits)
        labels = judge(scene, scene.truth.boxes[::-1])
        assert per_frame(labels.wrong) == 2.0
        assert per_frame(labels.unlike) == unlike


def test_a_label_on_nothing_is_wrong_whoever_wears_what() -> None:
    scene = two_apart((0, 0))
    labels = judge(scene, scene.truth.boxes + 1000.0)
    assert per_frame(labels.wrong) == per_frame(labels.unlike) == 2.0


def test_a_label_is_missing_only_where_its_object_was_found() -> None:
    scene = two_apart()
    nowhere = np.full_like(scene.truth.boxes, np.nan)
    assert per_frame(judge(scene, nowhere).missing) == 2.0
    blind = replace(scene, seen=((Detections.empty(2),) * 4,))
    assert per_frame(judge(blind, nowhere).missing) == 0.0


def test_each_object_has_one_track_and_each_track_one_object() -> None:
    truth = two_apart().truth
    wandering = np.concatenate([truth.boxes[0, :3], truth.boxes[1, 3:]])
    boxes = named(truth, {7: wandering, 9: truth.boxes[0]})
    np.testing.assert_array_equal(boxes[0], truth.boxes[0])
    np.testing.assert_array_equal(boxes[1], wandering)


@pytest.mark.parametrize("solver", ["arcs", "exact", "greedy-dp", "separate-dp"])
def test_people_who_stand_apart_keep_their_labels(solver: str) -> None:
    scene = two_apart()
    window = window_of_frames(3, 2)
    followed = follow(scene, PAPER_COSTS, window, create_solver(solver))
    assert len(followed.reports) == 1  # three frames after the templates'
    np.testing.assert_array_equal(followed.boxes, scene.truth.boxes)


def test_people_who_are_not_known_are_found() -> None:
    scene = play(replace(CAST, known=False), 1)
    followed = follow(scene, CostSettings(), WindowSettings(), create_solver("arcs"))
    assert (~np.isnan(followed.boxes[..., 0])).mean() > 0.7
    assert per_frame(judge(scene, followed.boxes).wrong) < 0.1


def test_separate_paths_share_boxes_where_the_program_does_not() -> None:
    scene = play(SceneParameters((0, 0), FRAMES, WalkParameters(6.0, 0.25, side=140.0)), 3)
    together = follow(scene, PAPER.costs, PAPER.window, create_solver("arcs"))
    apart = follow(scene, PAPER.costs, PAPER.window, create_solver("separate-dp"))
    assert sum(report.conflicts for report in together.reports) == 0
    assert sum(report.conflicts for report in apart.reports) > 0


def test_toys_in_full_view_are_among_their_own_peaks() -> None:
    scene = play_toys(4, seed=1, peaks=40)
    assert len(scene.seen) == TOYS
    for k, frames in enumerate(scene.seen):
        for t, seen in enumerate(frames):
            assert len(seen) <= 40
            assert iou(scene.truth.boxes[k, t], seen.boxes).max() > 0.8


def test_an_experiment_prints_its_table_and_saves_its_plot(tmp_path: Path) -> None:
    settings = (TrackerSetting("paper", PAPER.costs, PAPER.window),)
    figures = (PaperFigure("arcs", "0.123", "2 of 3"),)
    experiment = Experiment("tiny", "two people", "Fig. 0", lambda seed: play(CAST, seed), settings, figures)
    report = Report()
    run(experiment, 1, report, tmp_path)
    report.save(tmp_path / "table.txt")
    text = (tmp_path / "table.txt").read_text(encoding="utf-8")
    assert "paper: separate-dp" in text
    assert "the paper's recording: arcs" in text
    assert "0.123" in text
    assert "2 of 3" in text
    assert "3 of 3" in text
    assert (tmp_path / "paper_experiments-tiny.png").stat().st_size > 10_000


def test_the_papers_first_example_is_solved_to_the_letter_in_one_segment() -> None:
    """340 frames, both objects known, layout term, corner rule and star rows.

    The program is integral without the layout term, and nearly so with it.
    """
    [example] = [experiment for experiment in EXPERIMENTS if experiment.name == "example"]
    scene, setting = example.play(1), example.settings[0]
    costs = setting.costs
    assert (costs.layout > 0.0, costs.conflict_rule, costs.conflict_rows) == (True, "corners", "star")
    followed = follow(scene, costs, setting.window, create_solver("arcs"))
    [report] = followed.reports
    assert report.gap < 0.003
    assert followed.boxes.shape[1] == 340
    [free] = follow(scene, replace(costs, layout=0.0), setting.window, create_solver("arcs")).reports
    assert (free.integral, free.status) == (True, "optimal")


@pytest.mark.slow
def test_the_four_players_are_solved_in_one_segment() -> None:
    """500 frames: a program of all arcs is beyond the budget; its answer would be that of greedy paths."""
    [four] = [experiment for experiment in EXPERIMENTS if experiment.name == "four"]
    setting = four.settings[0]
    found = attempt(four.play(1), setting, setting.solvers[0])
    assert (found.stopped, found.integral) == (0, 1)
    assert found.gap < 1e-9


def test_a_table_says_where_the_budget_ended_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    setting = TrackerSetting("paper", PAPER.costs, PAPER.window)
    monkeypatch.setattr(paper_experiments, "BUDGET", SolverBudget(work_s=1e-6))
    outcome = attempt(play(CAST, 1), setting, "arcs")
    assert "3 stopped" in row(setting, "arcs", [outcome])[4]
