"""`myview evaluate`: tables and JSON from files, and one-line errors."""

from __future__ import annotations

import gzip
import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from fakes.cli.command_line import RunCommand, input_error
from tracking.motchallenge import MotRow, format_rows

Printed = Callable[..., str]


@pytest.fixture
def run(myview: RunCommand) -> Printed:
    """Return a function that runs `myview evaluate` and returns its output."""

    def command(*arguments: object) -> str:
        result = myview("evaluate", *arguments)
        assert result.code == 0, result.err
        return result.out

    return command


@pytest.fixture
def refused(myview: RunCommand) -> Printed:
    """Return a function that runs `myview evaluate` and returns its one-line error."""
    return lambda *arguments: input_error(myview("evaluate", *arguments))


def people(numbers: tuple[int, ...], frames: range = range(1, 6)) -> str:
    return format_rows(
        MotRow(frame, number, 100.0 * place, 0.0, 40.0, 100.0)
        for frame in frames
        for place, number in enumerate(numbers)
    )


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


def each(option: str, paths: Iterable[Path]) -> list[str | Path]:
    """Repeat an option before each of its values."""
    return [word for path in paths for word in (option, path)]


def rows(printed: str) -> dict[str, list[str]]:
    """Return the table's rows by their first cell."""
    return {line.split()[0]: line.split() for line in printed.splitlines() if line.strip()}


def test_one_file_against_another(run: Printed, tmp_path: Path) -> None:
    tracks = write(tmp_path / "street.txt", people((1, 2)))
    truth = write(tmp_path / "truth.txt", people((7, 8)))
    table = rows(run("--tracks", tracks, "--gt", truth))
    assert table["camera"][1:6] == ["HOTA", "DetA", "AssA", "MOTA", "IDF1"]
    assert table["street"][1:6] == ["100.0"] * 5
    assert "joint" not in table


def test_a_rendered_folder_against_packed_truth(run: Printed, tmp_path: Path) -> None:
    for camera, numbers in (("c0", (1, 2)), ("c1", (2, 1))):
        write(tmp_path / "seen" / "tracks" / f"{camera}.txt", people(numbers))
        write(tmp_path / "hall" / "gt" / f"{camera}.txt.gz", people((5, 6)))
    write(tmp_path / "hall" / "gt" / "c2.txt", people((5, 6)))
    out = tmp_path / "numbers.json"
    table = rows(run("--tracks", tmp_path / "seen", "--gt", tmp_path / "hall", "--json", out))
    assert list(table) == ["camera", "c0", "c1", "mean,", "joint"]
    assert table["mean,"][2:][4] == "100.0"
    assert table["joint"][5] == "50.0"  # the identities are exchanged in the second camera
    numbers = json.loads(out.read_text(encoding="utf-8"))
    assert numbers["iou"] == 0.5
    assert list(numbers["cameras"]) == ["c0", "c1"]
    assert numbers["cameras"]["c0"]["idf1"] == numbers["mean"]["idf1"] == 1.0
    assert numbers["joint"]["idf1"] == 0.5


def test_empty_tracks_are_scored(run: Printed, tmp_path: Path) -> None:
    tracks = write(tmp_path / "c0.txt", "")
    table = rows(run("--tracks", tracks, "--gt", write(tmp_path / "gt.txt", people((1,)))))
    assert table["c0"][4] == "0.0"


def test_the_iou_threshold_is_configurable(run: Printed, tmp_path: Path) -> None:
    truth = write(tmp_path / "gt.txt", people((1,)))
    moved = write(tmp_path / "c0.txt", people((1,)).replace(",1,0.00,0.00,", ",1,16.00,0.00,"))
    assert rows(run("--tracks", moved, "--gt", truth))["c0"][6] == "0.0"
    assert rows(run("--tracks", moved, "--gt", truth, "--iou", 0.4))["c0"][6] == "100.0"


def test_a_missing_file_is_named(refused: Printed, tmp_path: Path) -> None:
    tracks = write(tmp_path / "c0.txt", people((1,)))
    assert refused("--tracks", tracks, "--gt", "nowhere.txt") == "myview: nowhere.txt: does not exist"


def test_files_are_paired_by_name_in_any_order(run: Printed, tmp_path: Path) -> None:
    found = [write(tmp_path / "seen" / f"c{number}.txt", people((number + 1,))) for number in range(3)]
    truth_files = [
        write(tmp_path / "gt" / f"c{number}.txt.gz", people((number + 1,))) for number in (2, 0, 1)
    ]
    once = rows(run(*each("--gt", truth_files), *each("--tracks", found)))
    assert list(once) == ["camera", "c0", "c1", "c2", "mean,", "joint"]
    assert once["joint"][5] == "100.0"
    assert rows(run(*each("--gt", truth_files), "--tracks", tmp_path / "seen")) == once


def test_a_second_value_without_a_repeated_option_is_refused(myview: RunCommand, tmp_path: Path) -> None:
    a, b = (write(tmp_path / f"{name}.txt", people((1,))) for name in "ab")
    result = myview("evaluate", "--gt", a, b, "--tracks", a, b)
    assert result.code == 2
    assert "unexpected extra argument" in result.err


def test_files_without_common_names_are_paired_by_order(run: Printed, tmp_path: Path) -> None:
    found = [write(tmp_path / f"{name}.txt", people((1,))) for name in ("left", "right")]
    truth_files = [write(tmp_path / name / "gt.txt", people((1,))) for name in ("a", "b")]
    assert list(rows(run(*each("--gt", truth_files), *each("--tracks", found)))) == [
        "camera",
        "left",
        "right",
        "mean,",
        "joint",
    ]
    table = rows(run(*each("--gt", found), *each("--tracks", truth_files)))
    assert list(table) == ["camera", "left", "right", "mean,", "joint"]


def test_files_that_cannot_be_paired_are_refused(refused: Printed, tmp_path: Path) -> None:
    a, b, c = (write(tmp_path / f"{name}.txt", people((1,))) for name in "abc")
    b2, a2 = (write(tmp_path / "gt" / f"{name}.txt", people((1,))) for name in "ba")
    assert "1 files of tracks (a.txt) for 2 of ground truth" in refused("--tracks", a, *each("--gt", (b2, c)))
    assert f"--tracks: {b}: there is no ground truth of that name" in refused(
        *each("--tracks", (a, b)), "--gt", a2
    )
    assert f"--gt: {b2}: there are no tracks of that name" in refused("--tracks", a, *each("--gt", (a2, b2)))
    assert "are both called 'a'" in refused(*each("--tracks", (a, a2)), "--gt", a2)
    assert "the cameras cannot be distinguished" in refused(
        *each("--tracks", (a, a2)), *each("--gt", (b, b2))
    )


def test_folders_without_common_names_are_refused(refused: Printed, tmp_path: Path) -> None:
    write(tmp_path / "a" / "c0.txt", people((1,)))
    view = write(tmp_path / "b" / "view1.txt", people((1,)))
    assert "c0.txt here, view1.txt there" in refused("--tracks", tmp_path / "a", "--gt", tmp_path / "b")
    assert "c0.txt here, view1.txt there" in refused("--tracks", tmp_path / "a", "--gt", view)


def test_a_folder_without_tracks_is_refused(refused: Printed, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert "no .txt or .txt.gz files" in refused("--tracks", tmp_path / "empty", "--gt", tmp_path / "empty")


def test_files_without_a_common_frame_are_refused(refused: Printed, tmp_path: Path) -> None:
    tracks = write(tmp_path / "c0.txt", people((1,)))
    truth = write(tmp_path / "gt.txt", people((1,), range(100, 121)))
    assert "frames 1 to 5 here, 100 to 120 there" in refused("--tracks", tracks, "--gt", truth)


def test_ground_truth_without_people_is_refused(refused: Printed, tmp_path: Path) -> None:
    tracks = write(tmp_path / "c0.txt", people((1,)))
    truth = write(tmp_path / "gt.txt", people((1,)).replace(",1.00,-1,", ",0,-1,"))
    assert "no person in it counts" in refused("--tracks", tracks, "--gt", truth)


def test_a_malformed_row_is_named(refused: Printed, tmp_path: Path) -> None:
    tracks = write(tmp_path / "c0.txt", people((1,)) + "6,1,left\n")
    truth = write(tmp_path / "gt.txt", people((1,)))
    assert f"{tracks}:6: " in refused("--tracks", tracks, "--gt", truth)


def test_detections_are_refused_as_tracks(refused: Printed, tmp_path: Path) -> None:
    tracks = write(tmp_path / "det.txt", people((-1, -1)))
    truth = write(tmp_path / "gt.txt", people((1,)))
    assert "these are detections, not tracks" in refused("--tracks", tracks, "--gt", truth)


def test_without_the_library_the_extra_is_named(
    refused: Printed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [*sys.modules]:
        if name.startswith(("tracking.evaluation", "server.cli.evaluate", "motrics")):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "motrics", None)
    tracks = write(tmp_path / "c0.txt", people((1,)))
    assert refused("--tracks", tracks, "--gt", tracks).endswith("pip install 'myview[evaluate]'")
