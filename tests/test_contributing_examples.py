"""The worked examples of CONTRIBUTING.md run: detector, tracker, view-quality term, output."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from fakes.paths import ROOT
from fakes.timeouts import PATIENCE

TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
EXAMPLES = dict(re.findall(r"^### (.*?)$.*?^```python\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE))


def test_there_is_an_example_of_each_extension() -> None:
    assert list(EXAMPLES) == ["a detector", "a tracker", "a view-quality term", "an output"]
    assert TEXT.count("```python\n") == len(EXAMPLES)


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs_and_its_assertions_hold(name: str, tmp_path: Path) -> None:
    """In a subprocess, since an example registers its extension."""
    script = tmp_path / "example.py"
    script.write_text(EXAMPLES[name], encoding="utf-8")
    assert "assert " in EXAMPLES[name]
    ran = subprocess.run(
        [sys.executable, str(script)],
        env={"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
