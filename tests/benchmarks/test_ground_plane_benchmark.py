"""The benchmark of a shared floor: its baseline, its rows, and its answer where the data is missing."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.ground_plane import __main__ as benchmark
from benchmarks.ground_plane import growth
from benchmarks.ground_plane.frame_by_frame import track_frame_by_frame
from benchmarks.ground_plane.methods import BY_FRAME, JOINT, rows_of, run_methods
from benchmarks.ground_plane.square import SimulatedSquare
from benchmarks.ground_plane.stages import NETWORK, OTHER, SOLVING, STAGES, StageClock
from benchmarks.ground_plane.wildtrack import wildtrack
from fakes.tracking.walked_floor import FPS, FloorNoise, detect_walkers, floor_views
from tracking import create_solver
from tracking.ground_plane import GroundPlaneTracker, GroundSettings, track_ground_plane

VIEWS = floor_views()
CAMERAS = {name: view.camera for name, view in VIEWS.items()}
FRAMES = 20
CROWD_FRAMES = 8
SHARES = np.linspace(0.0, 1.0, FRAMES)[:, None, None]
WALKS = (1.0 - SHARES) * [[2.0, 3.0], [8.0, 6.0]] + SHARES * [[8.0, 3.0], [2.0, 6.0]]
DETECTIONS = detect_walkers(np.asarray(WALKS), VIEWS, FloorNoise(deviation=0.005))


def test_frame_by_frame_two_people_are_two_in_all_cameras() -> None:
    rows = track_frame_by_frame(CAMERAS, DETECTIONS, FPS)
    assert {row.id for found in rows.values() for row in found} == {1, 2}
    assert {name: len(found) for name, found in rows.items()} == dict.fromkeys(CAMERAS, 2 * FRAMES)


def test_rows_count_frames_from_1() -> None:
    tracker = GroundPlaneTracker(CAMERAS, GroundSettings(), create_solver("arcs"), FPS)
    rows = rows_of(track_ground_plane(tracker, enumerate(DETECTIONS)), CAMERAS)
    for name, found in rows.items():
        assert [row.frame for row in found] == sorted([*range(1, FRAMES + 1)] * 2)
        assert found[0].box in [pytest.approx(box) for box in DETECTIONS[0][name].boxes]


def test_without_data_the_scene_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["ground_plane", "--data", str(tmp_path), "--out", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", [*command, "--scene", "wildtrack true"])
    benchmark.main()
    assert "wildtrack true: skipped: needs" in capsys.readouterr().out
    assert (tmp_path / "out" / "ground_plane.txt").exists()


def test_a_real_crowd_is_tracked_better_jointly_than_frame_by_frame(
    shared_data: Path, tmp_path: Path
) -> None:
    if not (shared_data / "wildtrack").is_dir():
        pytest.skip(f"needs {shared_data / 'wildtrack'}")
    scene = wildtrack(shared_data, tmp_path, "strong", 1)
    found = scene.detect()
    shown = {
        camera: replace(frames, detections=frames.detections[:CROWD_FRAMES])
        for camera, frames in found.frames.items()
    }
    truth = {camera: [row for row in rows if row.frame <= CROWD_FRAMES] for camera, rows in scene.gt.items()}
    joint, by_frame = run_methods(
        replace(scene, gt=truth), replace(found, frames=shown), [JOINT, BY_FRAME], "arcs"
    )
    assert joint.scores.joint.idf1 > max(0.8, by_frame.scores.joint.idf1)


def test_time_within_a_stage_counts_for_the_innermost(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter([0.0, 1.0, 3.0, 6.0, 10.0, 15.0])
    monkeypatch.setattr("benchmarks.ground_plane.stages.time.process_time", lambda: next(now))
    clock = StageClock()
    solve = clock.timed(SOLVING, lambda: None)
    clock.timed(NETWORK, solve)()
    clock.stop()
    assert clock.seconds == dict.fromkeys(STAGES, 0.0) | {OTHER: 1.0 + 5.0, NETWORK: 2.0 + 4.0, SOLVING: 3.0}


def test_everybody_on_the_simulated_square_is_tracked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(growth, "SIZES", ((4, 4), (4, 8)))
    monkeypatch.setattr(sys, "argv", ["growth", "--frames", "2", "--out", str(tmp_path)])
    growth.main()
    rows = [line.split("\u2502")[1:-1] for line in capsys.readouterr().out.splitlines() if "\u2502" in line]
    tracked = {tuple(cell.strip() for cell in (*row[:2], row[-1])) for row in rows}
    assert {("4", "4", "4"), ("4", "8", "8"), ("exponent in people", "", "")} <= tracked


def test_people_on_the_simulated_square_are_seen_by_most_cameras() -> None:
    found = next(SimulatedSquare(6, 20).frames(1))
    assert all(12 <= len(part) <= 22 for part in found.values())
