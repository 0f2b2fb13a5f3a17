"""The accuracy benchmarks on a recording of a few frames."""

from __future__ import annotations

import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from benchmarks import ablation, blurring
from benchmarks.ablation import ABLATIONS, DEFAULT, Ablation, cell
from benchmarks.common.environment import SKIPPED
from benchmarks.common.public_detections import Recording, find_recordings, track
from benchmarks.other_trackers import __main__ as peers
from benchmarks.other_trackers import virtual_environment as peer_environment
from benchmarks.other_trackers.virtual_environment import OtherTrackersUnavailableError
from fakes.service.scripted_cameras import small_config
from server.cli.track.command import track_one
from server.config.sections import TrackSettings
from server.system.errors import UserError
from tracking import PAPER, OnlineTracker
from tracking.evaluation import Scores
from tracking.motchallenge import MotRow, read_rows, write_rows

FRAMES = 30


def scores(hota: float, idf1: float, switches: int) -> Scores:
    return Scores(hota, hota, hota, hota, idf1, 1, 1, switches, 0, 0, 0, 2, 2)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Return a data folder with one recording: two people pass each other at a distance."""
    people = [
        MotRow(frame, number, left, 100.0 * number, 40.0, 90.0)
        for frame in range(1, FRAMES + 1)
        for number, left in ((1, 3.0 * frame), (2, 300.0 - 3.0 * frame))
    ]
    folder = tmp_path / "data" / "mot15" / "TUD-Campus"
    folder.mkdir(parents=True)
    write_rows(folder / "gt.txt", people)
    write_rows(
        folder / "det.txt",
        [
            MotRow(person.frame, -1, person.left, person.top, person.width, person.height, 0.9)
            for person in people
        ],
    )
    return tmp_path / "data"


@pytest.fixture
def recording(data: Path) -> Recording:
    return find_recordings(data)[0]


def test_measured_tracks_are_those_that_the_command_writes(recording: Recording, tmp_path: Path) -> None:
    out = tmp_path / "tracks.txt"
    track_one(None, recording.detections, out, None, None, lambda _: None)
    assert track(recording) == read_rows(out)
    assert recording.score(track(recording)).idf1 > 0.9


def test_a_recording_is_tracked_at_its_true_rate(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    rates: list[float] = []

    def noted(*settings: Any) -> OnlineTracker:
        rates.append(settings[3])
        return OnlineTracker(*settings)

    monkeypatch.setattr("benchmarks.common.public_detections.OnlineTracker", noted)
    track(replace(recording, fps=7.0))
    assert rates == [7.0]


@pytest.mark.parametrize("term", ABLATIONS, ids=lambda term: term.name)
def test_the_settings_of_an_ablation_exist(term: Ablation, recording: Recording) -> None:
    track(recording, term.settings)


def test_each_way_in_which_the_live_tracker_differs_from_the_paper_has_a_row() -> None:
    """A row for a whole preset is none for each of its settings."""
    live, few = TrackSettings(), 4
    papers = {"costs": asdict(PAPER.costs), "window": asdict(PAPER.window)}
    deviations = {
        (section, name)
        for section, settings in papers.items()
        for name, value in settings.items()
        if getattr(getattr(live, section), name) != value
    }
    rows = {
        (section, name)
        for row in ABLATIONS
        for section, settings in row.settings.items()
        if len(settings) <= few
        for name in settings
    }
    assert ("costs", "layout") in deviations
    assert deviations <= rows


def test_an_unknown_setting_is_refused(recording: Recording) -> None:
    with pytest.raises(UserError, match="luck"):
        track(recording, {"costs": {"luck": 1.0}})


def test_the_cell_of_an_ablation_is_the_difference() -> None:
    default, ablated = scores(0.5, 0.6, 7), scores(0.45, 0.62, 12)
    assert [cell(name, default, None) for name in ("hota", "idf1", "switches")] == ["50.0", "60.0", "7"]
    assert [cell(name, ablated, default) for name in ("hota", "idf1", "switches")] == ["-5.0", "+2.0", "+5"]


def test_the_ablation_has_a_row_for_each_term(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ablation, "ABLATIONS", ABLATIONS[:1])
    ablation.run(find_recordings(data), tmp_path / "out", jobs=1)
    printed = (tmp_path / "out" / "ablation.txt").read_text(encoding="utf-8")
    assert printed.count(DEFAULT.name) == printed.count(ABLATIONS[0].name) == len(ablation.SCORES)


def test_myview_is_compared_with_the_best_other_tracker_of_each_score() -> None:
    table = {
        "street": {
            "MyView": scores(0.5, 0.6, 7),
            "SORT": scores(0.4, 0.7, 9),
            "C-BIoU": scores(0.3, 0.5, 6),
            "perfect association": scores(1.0, 1.0, 0),
        }
    }
    assert peers.lead(table) == [["street", "+10.0", "+10.0", "-10.0", "+1"]]


def test_without_other_trackers_myview_is_still_measured(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "no-python"))
    peers.run(data, tmp_path / "out", tmp_path / "environment", None, pictures=True)
    printed = (tmp_path / "out" / "other_trackers.txt").read_text(encoding="utf-8")
    assert "without other trackers, which cannot be installed here: " in printed
    assert "MyView" in printed
    assert "perfect association" in printed
    assert (tmp_path / "out" / "other_trackers.png").stat().st_size > 1000


def test_an_incomplete_environment_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    incomplete = tmp_path / "environment" / "bin"
    incomplete.mkdir(parents=True)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "no-python"))
    with pytest.raises(OtherTrackersUnavailableError):
        peer_environment.peer_environment(tmp_path / "environment")
    assert not incomplete.exists()


def test_a_complete_environment_is_reused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / ".done").touch()
    monkeypatch.setattr(sys, "executable", str(tmp_path / "no-python"))
    found = peer_environment.peer_environment(tmp_path)
    assert found.python == tmp_path / "bin" / "python"


def test_without_recordings_the_benchmarks_are_skipped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for benchmark in (peers, ablation):
        monkeypatch.setattr(sys, "argv", ["x", "--data", str(tmp_path), "--out", str(tmp_path / "out")])
        with pytest.raises(SystemExit) as ended:
            benchmark.main()
        assert ended.value.code == SKIPPED
        assert "skipped: needs detections and ground truth" in capsys.readouterr().out


def test_the_shares_of_pixelated_bodies_and_heads_are_of_all_true_boxes() -> None:
    person = (10.0, 8.0, 20.0, 28.0)  # whose head is 4 pixels high
    truth = {"c0": [MotRow(frame, 1, 10.0, 8.0, 10.0, 20.0) for frame in (1, 2, 3, 4)]}
    hidden = {"c0": {0: [person], 1: [(10.0, 18.0, 20.0, 28.0)], 2: [], 3: None}}
    cells = blurring.score(small_config(["c0"]), truth, hidden, 4)
    assert cells == ["4", "62.5", "50.0", "50.0", "100.0", "25.0", "25.0"]
