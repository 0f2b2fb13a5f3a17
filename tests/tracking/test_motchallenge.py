"""MOTChallenge text: strict in, deterministic out."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracking.motchallenge import MotRow, format_row, format_rows, parse_rows, read_rows, write_rows

_hundredths = st.integers(-1_000_000, 1_000_000).map(lambda n: n / 100)
_sizes = st.integers(1, 1_000_000).map(lambda n: n / 100)
rows = st.builds(
    MotRow,
    frame=st.integers(1, 10_000),
    id=st.integers(-1, 500),
    left=_hundredths,
    top=_hundredths,
    width=_sizes,
    height=_sizes,
    confidence=st.integers(0, 100).map(lambda n: n / 100),
)


@given(st.lists(rows, max_size=20))
def test_written_rows_are_read_back(written: list[MotRow]) -> None:
    text = format_rows(written)
    read = list(parse_rows(text.splitlines(), "x"))
    assert format_rows(read) == text
    assert sorted(map(format_row, read)) == sorted(map(format_row, written))
    assert [(row.frame, row.id) for row in read] == sorted((row.frame, row.id) for row in written)


@given(st.text(max_size=80))
@settings(deadline=None, max_examples=150)
def test_any_text_is_read_or_refused_in_one_line(text: str) -> None:
    try:
        found = list(parse_rows(text.splitlines(), "file.txt"))
    except ValueError as error:
        message = str(error)
        assert message.startswith("file.txt:")
        assert "\n" not in message
        assert len(message) < 200
    else:
        assert all(row.frame >= 1 and row.width > 0 and row.height > 0 for row in found)


def _refusal(lines: list[str]) -> str:
    """Return the error for refused lines; empty where they are read."""
    try:
        list(parse_rows(lines, "f"))
    except ValueError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("field", range(7))
def test_an_overlong_field_is_shortened_in_the_message(field: int) -> None:
    fields = ["1", "1", "0", "0", "5", "5", "1"]
    for text in ("x" * 5000, "9" * 5000, *([".3" + "9" * 500, "9" * 300] if field < 2 else [])):
        fields[field] = text
        assert 0 < len(_refusal([",".join(fields)])) < 400


_FIELDS = ["1", "-1", "2.5", "nan", "inf", "", " 3 ", "1e999", "x", "1e400"]


@given(st.lists(st.sampled_from(_FIELDS), max_size=12))
def test_any_fields_are_read_or_refused(fields: list[str]) -> None:
    line = ",".join(fields)
    refusal = _refusal([line])
    if refusal:
        assert refusal.startswith("f:1: ")
    else:
        assert all(abs(number) < float("inf") for row in parse_rows([line], "f") for number in row.box)


@given(st.binary(max_size=60))
@settings(deadline=None, max_examples=50)
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz.txt"
    path.write_bytes(content)
    try:
        refusal, found = path.name, read_rows(path)
    except ValueError as error:
        refusal, found = str(error), []
    assert path.name in refusal
    assert all(row.frame >= 1 for row in found)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("1,2,3", "expected 6 to 10 fields, found 3"),
        ("0,1,2,3,4,5", "frame 0 is not between"),
        ("1.5,1,2,3,4,5", "frame is a whole number, not '1.5'"),
        ("1,one,2,3,4,5", "id is a number, not 'one'"),
        ("1,1,2,3,0,5", "positive width and height, not 0 x 5"),
        ("1,1,nan,3,4,5", "left is a finite number, not 'nan'"),
        ("99999999999,1,2,3,4,5", "frame 99999999999 is not between"),
        ("1,1,1e308,3,1e308,5", "box coordinates are pixels up to 1e.09"),
        ("1,1e300,2,3,4,5", "id 1e300 is not between"),
    ],
)
def test_errors_name_file_line_and_reason(tmp_path: Path, line: str, complaint: str) -> None:
    path = tmp_path / "det.txt"
    path.write_text(f"1,1,2,3,4,5\n\n{line}\n")
    with pytest.raises(ValueError, match=complaint) as caught:
        read_rows(path)
    assert str(caught.value).startswith(f"{path}:3: ")


def test_numbers_have_two_decimals_and_no_negative_zero() -> None:
    row = MotRow(7, 3, -0.001, 1.005, 2.0, 3.14159, 0.5)
    assert format_row(row) == "7,3,0.00,1.00,2.00,3.14,0.50,-1,-1,-1"


def test_ground_truth_has_the_visible_share() -> None:
    truth, result = parse_rows(["1,1,2,3,4,5,1,1,0.25", "1,1,2,3,4,5,1,-1,-1,-1"], "gt")
    assert (truth.visible, result.visible) == (0.25, -1.0)
    assert truth.box == (2.0, 3.0, 6.0, 8.0)


def test_a_file_is_written_whole(tmp_path: Path) -> None:
    path = tmp_path / "out.txt"
    write_rows(path, [MotRow(2, 1, 0, 0, 1, 1), MotRow(1, 1, 0, 0, 1, 1)])
    assert [row.frame for row in read_rows(path)] == [1, 2]
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.txt"]


def test_a_gzip_file_is_read_like_its_text(tmp_path: Path) -> None:
    path = tmp_path / "c0.txt.gz"
    path.write_bytes(gzip.compress(b"1,2,3,4,5,6,1\n"))
    assert read_rows(path) == [MotRow(1, 2, 3, 4, 5, 6)]


@pytest.mark.parametrize("cut", [0, 5, -9])
def test_a_broken_gzip_file_is_refused_in_one_line(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "c0.txt.gz"
    whole = gzip.compress(b"1,2,3,4,5,6,1\n" * 50)
    path.write_bytes(b"1,2,3,4,5,6,1\n" if cut == 0 else whole[:cut])
    with pytest.raises(ValueError, match="not a complete gzip file") as refused:
        read_rows(path)
    assert "\n" not in str(refused.value)


def test_the_public_files_are_read(shared_data: Path) -> None:
    assert len(read_rows(shared_data / "mot15" / "TUD-Campus" / "det.txt")) > 100
    assert {row.visible for row in read_rows(shared_data / "terrace" / "gt" / "c0.txt")} == {0.0, 1.0}


def test_a_row_of_a_box_has_that_box() -> None:
    row = MotRow.of_box(3, 7, [10.0, 20.0, 30.0, 60.0], 0.5)
    assert (row.frame, row.id, row.width, row.height, row.confidence) == (3, 7, 20.0, 40.0, 0.5)
    assert row.box == (10.0, 20.0, 30.0, 60.0)
