"""`myview evaluate --views`: choices compared with the optimum, matched by number or by tracks."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import pytest

from fakes.cli.command_line import BAD_INPUT, RunCommand, input_error
from fakes.media.videos import write_video

FRAMES = 20
SIZE = ("--size", "100x100", "--fps", "10")
BIG, SMALL = "10,10,50,50", "10,10,20,20"


@pytest.fixture
def evaluate(myview: RunCommand) -> RunCommand:
    """Return a function that runs `myview evaluate`."""
    return lambda *arguments: myview("evaluate", *arguments)


def write(path: Path, lines: list[str]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(f"{line}\n" for line in lines), encoding="ascii")
    return path


def boxes(places: Mapping[int, str], frames: range = range(1, FRAMES + 1), end: str = "1,1,1") -> list[str]:
    """Return MOTChallenge rows: everyone at one place all the time."""
    return [f"{frame},{number},{place},{end}" for frame in frames for number, place in places.items()]


def choices(shown: Mapping[int, str], frames: range = range(1, FRAMES + 1)) -> list[str]:
    return [
        "frame,object,camera",
        *(f"{frame},{number},{camera}" for frame in frames for number, camera in shown.items()),
    ]


@pytest.fixture
def served(tmp_path: Path) -> Path:
    """Two people in two cameras: the first is larger in c0, the second in c1."""
    write(tmp_path / "gt" / "c0.txt", boxes({1: BIG, 2: SMALL}))
    write(tmp_path / "gt" / "c1.txt", boxes({1: SMALL, 2: BIG}))
    return tmp_path


def judged(printed: str) -> dict[str, list[str]]:
    """Return the table's rows by their first cell."""
    return {line.split()[0]: line.split() for line in printed.splitlines()}


def test_the_best_choices_agree_with_the_optimum(evaluate: RunCommand, served: Path) -> None:
    path = write(served / "choices.csv", choices({1: "c0", 2: "c1"}))
    code, out, _ = evaluate("--gt", served, "--views", path, *SIZE)
    assert code == 0
    table = judged(out)
    assert table["person"][3:8] == ["Agree", "Regret", "Visible", "Chosen", "Cuts"]
    assert table["all"] == ["all", "40", "100.0", "0.0", "100.0", "100.0", "0.0", "0.0", "-"]
    assert table["2"][:4] == ["2", "2", "20", "100.0"]


def test_worse_choices_cost_more_and_the_json_file_has_all_scores(evaluate: RunCommand, served: Path) -> None:
    shown = [
        *choices({1: "c0"}),
        *choices({2: "c1"}, range(1, 11))[1:],
        *choices({2: "c0"}, range(11, 16))[1:],
    ]
    path, out = write(served / "choices.csv", shown), served / "numbers.json"
    assert evaluate("--gt", served, "--views", path, *SIZE, "--switch-cost", 0.2, "--json", out)[0] == 0
    content = json.loads(out.read_text())["views"]
    assert content["all"]["frames"] == 40
    assert content["all"]["agreement"] == 30 / 40
    assert content["all"]["chosen"] == 35 / 40
    assert content["all"]["visible"] == 35 / 40
    assert content["people"]["1"]["regret"] == 0.0
    # 5 frames of a view two fifths as large as the best, 5 of none, and a cut worth 2 frames.
    assert content["people"]["2"]["cost"] == pytest.approx(5 * 0.6 + 5 * 1.0 + 2.0)
    assert content["people"]["2"]["optimum_cost"] == 0.0
    assert content["people"]["2"]["regret"] is None, "the optimum is free"
    assert content["people"]["2"]["cuts_per_minute"] == pytest.approx(30.0)
    assert (content["fps"], content["switch_cost_s"]) == (10.0, 0.2)


def test_objects_are_matched_to_people_by_their_tracks(evaluate: RunCommand, served: Path) -> None:
    write(served / "seen" / "tracks" / "c0.txt", boxes({7: BIG, 4: SMALL}, range(1, 16)))
    write(served / "seen" / "tracks" / "c1.txt", boxes({7: SMALL, 4: BIG}, range(1, 16)))
    path = write(served / "seen" / "choices.csv", choices({7: "c0", 4: "c1", 9: "c1"}, range(1, 16)))
    code, out, err = evaluate("--gt", served, "--tracks", served / "seen", "--views", path, *SIZE)
    assert (code, err) == (0, "")
    table = judged(out)
    assert table["joint"][0] == "joint"
    assert table["1"][:4] == ["1", "7", "20", "75.0"]
    assert table["2"][:4] == ["2", "4", "20", "75.0"]
    assert table["all"][5] == "75.0", "the last five frames have no choice"
    assert "none of its objects" in evaluate("--gt", served, "--views", path, *SIZE)[2]


def test_an_object_that_switches_people_matches_one_of_them(evaluate: RunCommand, served: Path) -> None:
    halves = [*boxes({5: BIG}, range(1, 13)), *boxes({5: SMALL}, range(13, 21))]
    write(served / "tracks" / "c0.txt", halves)
    write(served / "tracks" / "c1.txt", [])
    path = write(served / "choices.csv", choices({5: "c0"}))
    code, out, _ = evaluate("--gt", served / "gt", "--tracks", served / "tracks", "--views", path, *SIZE)
    assert code == 0
    table = judged(out)
    assert table["1"][1] == "5"
    assert table["2"][1] == "-"
    assert table["2"][6] == "0.0"


def test_a_hidden_person_is_not_visible_by_default(evaluate: RunCommand, tmp_path: Path) -> None:
    write(tmp_path / "gt" / "c0.txt", boxes({1: BIG}, end="1,1,0.1"))
    write(tmp_path / "gt" / "c1.txt", boxes({1: SMALL}))
    path = write(tmp_path / "choices.csv", choices({1: "c0"}))
    outputs = [
        evaluate("--gt", tmp_path, "--views", path, *SIZE, "--visible", visible)[1] for visible in (0.25, 0)
    ]
    assert [judged(output)["all"][4] for output in outputs] == ["0.0", "100.0"]


def test_rate_and_sizes_are_read_from_a_rendering(evaluate: RunCommand, served: Path) -> None:
    path = write(served / "choices.csv", choices({1: "c1", 2: "c1"}))
    assert "size of camera c0's picture is not known" in evaluate("--gt", served, "--views", path)[2]
    site = {"fps": 10.0, "switch_cost_s": 0.3, "sizes": {"c0": [100, 100], "c1": [50, 50]}}
    (served / "site.json").write_text(json.dumps(site))
    out = served / "numbers.json"
    assert evaluate("--gt", served, "--views", path, "--json", out)[0] == 0
    content = json.loads(out.read_text())["views"]
    assert content["switch_cost_s"] == 0.3
    # 20 pixels of 50 in c1 are four fifths of 50 pixels of 100 in c0.
    assert content["people"]["1"]["cost"] == pytest.approx(20 * 0.2)


def test_plots_show_the_choice_and_the_frames_around_its_cuts(evaluate: RunCommand, served: Path) -> None:
    for camera in ("c0", "c1"):
        write_video(served / f"{camera}.mp4", FRAMES)
    path = write(
        served / "choices.csv", [*choices({1: "c0"}, range(1, 9)), *choices({1: "c1"}, range(9, 21))[1:]]
    )
    videos = ("--videos", served / "c0.mp4", "--videos", served / "c1.mp4")
    code, _, err = evaluate("--gt", served, "--views", path, *videos, *SIZE, "--plots", served / "plots")
    assert (code, err) == (0, "")
    assert {path.name for path in (served / "plots").iterdir()} == {"choices.png", "person-1.png"}
    assert all(path.stat().st_size > 1000 for path in (served / "plots").iterdir())


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        (["frame,camera", "1,c0"], "its first line is not frame,object,camera"),
        (["frame,object,camera", "1,1"], "choices.csv:2: expected 3 fields, found 2"),
        (["frame,object,camera", "0,1,c0"], "choices.csv:2: frame and object are whole numbers from 1"),
        (["frame,object,camera", "1,x,c0"], "not '1' and 'x'"),
        (["frame,object,camera", "1,0,c0"], "not '1' and '0'"),
        (["frame,object,camera", "99,1,c0"], "begins with frame 99; the ground truth ends with frame 20"),
        (["frame,object,camera", "1,1,c0", "1,1,c1"], "choices.csv:3: object 1 has two cameras in one frame"),
        (["frame,object,camera", "1,1,c9"], "camera 'c9' is not among those that are scored (c0, c1)"),
    ],
)
def test_an_invalid_choices_file_is_refused(
    evaluate: RunCommand, served: Path, lines: list[str], reason: str
) -> None:
    code, out, err = evaluate("--gt", served, "--views", write(served / "choices.csv", lines), *SIZE)
    assert (code, out) == (BAD_INPUT, "")
    assert reason in err
    assert len(err.splitlines()) == 1


def test_invalid_options_are_refused(evaluate: RunCommand, served: Path) -> None:
    path = write(served / "choices.csv", choices({1: "c0"}))
    for arguments, reason in (
        ([], "give --tracks, --views, or both"),
        (["--tracks", served, "--plots", served / "p"], "--plots and --videos need --views"),
        (["--views", served / "none.csv", *SIZE], "none.csv: cannot be read"),
        (["--views", path, "--size", "big", "--fps", 10], "--size: 'big' is not WIDTHxHEIGHT"),
        (["--views", path, "--size", "9x9"], "the number of frames a second is not known"),
        (
            ["--views", path, "--videos", "c0.mp4", "--videos", "x.mp4"],
            "--videos: give one for each of the cameras",
        ),
    ):
        code, out, err = evaluate("--gt", served, *arguments)
        assert (code, out) == (BAD_INPUT, ""), reason
        assert reason in err


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('{"fps": 3}', "was not written by `myview render`"),
        ('{"fps": 3, "switch_cost_s": 1, "sizes": {"c0": [1e999, 9]}}', "was not written by `myview render`"),
        ("[" * 100_000, "was not written by `myview render`"),
        ('{"fps": 3, "switch_cost_s": NaN, "sizes": {"c0": [9, 9]}}', "invalid rate, size or cost"),
        ('{"fps": 3, "switch_cost_s": 1, "sizes": {"c0": [9, 0]}}', "invalid rate, size or cost"),
        ('{"fps": 0, "switch_cost_s": 1, "sizes": {"c0": [9, 9]}}', "invalid rate, size or cost"),
    ],
)
def test_an_invalid_site_file_is_refused(evaluate: RunCommand, served: Path, text: str, reason: str) -> None:
    path = write(served / "choices.csv", choices({1: "c0"}))
    (served / "site.json").write_text(text)
    assert reason in input_error(evaluate("--gt", served, "--views", path))


def test_a_person_twice_in_a_frame_is_refused(evaluate: RunCommand, served: Path) -> None:
    write(served / "gt" / "c1.txt", [*boxes({2: SMALL}), *boxes({2: BIG}, range(7, 9))])
    path = write(served / "choices.csv", choices({1: "c0"}))
    line = input_error(evaluate("--gt", served, "--views", path, *SIZE))
    assert line.endswith("--gt: camera c1: person 2 is twice in frame 7")


def test_all_requested_files_are_written_or_none(evaluate: RunCommand, served: Path) -> None:
    path = write(served / "choices.csv", choices({1: "c0"}))
    options = ("--gt", served, "--views", path, *SIZE, "--plots", served / "plots")
    assert "cannot write there" in input_error(evaluate(*options, "--json", path / "numbers.json"))
    assert not (served / "plots").exists()


def test_views_may_be_folders_of_images(evaluate: RunCommand, served: Path) -> None:
    for camera in ("c0", "c1"):
        (served / "views" / camera).mkdir(parents=True)
        cv2.imwrite(str(served / "views" / camera / "1.png"), np.zeros((100, 100, 3), dtype=np.uint8))
    path = write(served / "choices.csv", choices({1: "c0", 2: "c1"}))
    videos = ("--videos", served / "views" / "c0", "--videos", served / "views" / "c1")
    same = evaluate("--gt", served, "--views", path, *SIZE)
    assert evaluate("--gt", served, "--views", path, *videos, "--fps", 10) == same
