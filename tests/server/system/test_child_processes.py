"""One module starts all child processes, with their limits, priorities and signals."""

from __future__ import annotations

import re
from pathlib import Path

import server

STARTS = re.compile(
    r"create_subprocess|subprocess\.(run|Popen|call|check)|\bProcess\(target|os\.fork|get_context"
)


def test_no_other_module_of_the_server_starts_processes() -> None:
    root = Path(server.__path__[0])
    starting = [path for path in root.rglob("*.py") if STARTS.search(path.read_text("utf-8"))]
    assert [str(path.relative_to(root)) for path in starting] == ["system/child_process.py"]
