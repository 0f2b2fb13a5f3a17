"""Texts are appended to all files or to none, on a disk of any size."""

from __future__ import annotations

import contextlib
import itertools
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.system.full_disk import files_of_at_most
from server.service.decision_files.decision_writer import AtomicFiles

NAMES = ("a", "b", "c")
rows = st.text(st.sampled_from("0123456789,\n"), max_size=30)
texts = st.dictionaries(st.sampled_from(NAMES), rows)


@given(heads=st.tuples(rows, rows, rows), appended=st.lists(texts, max_size=12), most=st.integers(0, 200))
def test_texts_are_appended_to_all_files_or_to_none(
    heads: tuple[str, ...], appended: list[dict[str, str]], most: int
) -> None:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        files = AtomicFiles({folder / name: head for name, head in zip(NAMES, heads, strict=True)})
        expected = dict(zip(NAMES, heads, strict=True))
        for texts_by_name in appended:
            longer = {name: expected[name] + texts_by_name.get(name, "") for name in NAMES}
            fits = all(len(longer[name]) <= most for name in texts_by_name if texts_by_name[name])
            refused = contextlib.nullcontext() if fits else pytest.raises(OSError, match="too large")
            with files_of_at_most(most), refused:
                files.append({folder / name: text for name, text in texts_by_name.items()})
                expected = longer
            assert {name: (folder / name).read_text() for name in NAMES} == expected
        files.close()


def test_after_a_failure_appending_continues_where_it_was(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    files = AtomicFiles({one: "head\n", other: ""})
    with files_of_at_most(8):
        files.append({other: "12\n"})
        with pytest.raises(OSError, match="too large"):
            files.append({other: "34\n", one: "56789\n"})
    files.append({one: "7\n"})
    files.append({other: "8\n"})
    files.close()
    assert (one.read_text(), other.read_text()) == ("head\n7\n", "12\n8\n")


def test_a_failed_creation_leaves_no_file_open(tmp_path: Path) -> None:
    opened = len(list(Path("/proc/self/fd").iterdir()))
    for _, missing in itertools.product(range(3), ("no folder/one", "also/none")):
        with pytest.raises(FileNotFoundError):
            AtomicFiles({tmp_path / "there": "", tmp_path / missing: ""})
    assert len(list(Path("/proc/self/fd").iterdir())) == opened
