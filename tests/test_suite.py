"""The runner of the suite: each result is counted once."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import pytest

from suite import Outcome, closing_line, run_often, run_pytest

MIXED = """
import pytest

def test_passes(): ...
def test_fails(): assert False
def test_is_skipped(): pytest.skip("needs a moon")
@pytest.fixture
def broken(): raise ValueError
def test_cannot_begin(broken): ...
"""


def write_test(folder: Path, text: str) -> Path:
    (folder / "test_it.py").write_text(text)
    return folder


def test_every_outcome_is_counted_once(tmp_path: Path) -> None:
    outcome = run_pytest("part", ["-q", "-p", "no:cacheprovider"], folder=write_test(tmp_path, MIXED))
    assert (outcome.passed, outcome.failed, outcome.skipped) == (1, 2, Counter({"needs a moon": 1}))


def test_a_test_skipped_for_another_reason_has_failed(tmp_path: Path) -> None:
    outcome = run_pytest("part", ["-q", "-p", "no:cacheprovider"], "Docker", write_test(tmp_path, MIXED))
    assert (outcome.passed, outcome.failed, outcome.skipped) == (1, 3, Counter())


@pytest.mark.parametrize("text", ["import os\ndef test_dies(): os._exit(0)", "1 +"])
def test_a_crashed_run_has_failed(tmp_path: Path, text: str) -> None:
    outcome = run_pytest("part", ["-q", "-p", "no:cacheprovider"], folder=write_test(tmp_path, text))
    assert outcome.failed


def test_the_closing_line_is_the_sum_of_all_parts() -> None:
    parts = [
        Outcome("first", 61.5, passed=5, failed=1, skipped=Counter({"needs a moon": 2})),
        Outcome("second", not_run="no compiler"),
        Outcome("third", 3600.0, passed=7),
    ]
    assert closing_line(parts).strip("= ") == "1 failed, 12 passed, 2 skipped in 3661.50s (1:01:01)"
    assert closing_line(parts[2:]).strip("= ") == "7 passed in 3600.00s (1:00:00)"


def test_one_failure_of_many_runs_is_a_failure(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    once = f"import os; os.mkdir({str(tmp_path / 'made')!r}); print('made')"  # fails in the second run
    assert not run_often([sys.executable, "-c", once], runs=3, at_once=2)
    printed = capfd.readouterr().out
    assert printed.count("FileExistsError") == 2
    assert printed.rstrip().endswith("1 of 3 runs without a failure")
    assert run_often([sys.executable, "-c", "print('passed')"], runs=2, at_once=2)
