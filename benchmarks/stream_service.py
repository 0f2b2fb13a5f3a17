"""The real best-view process, which notes when each GOP was given to the streams.

    python -m benchmarks.stream_service NOTES bestview SITE.yaml

is `myview bestview SITE.yaml` with one method wrapped; nothing else is changed.
"""

from __future__ import annotations

import functools
import sys
import time
from pathlib import Path

from server.run.cli import main as command_line
from server.view.decide import GopDecision
from server.view.splice import Splicer


def note(path: Path) -> None:
    """Write a line for each GOP before it is sent: its first pulse, and when that was."""
    original = Splicer.decision
    notes = path.open("a", encoding="ascii", buffering=1)

    @functools.wraps(original)
    def run(self: Splicer, decision: GopDecision) -> None:
        notes.write(f"{decision.first} {time.monotonic()}\n")
        original(self, decision)

    Splicer.decision = run  # type: ignore[method-assign]


def read(path: Path) -> dict[int, float]:
    """Give when each GOP was sent, by its first pulse."""
    lines = path.read_text(encoding="ascii").splitlines()
    return {int(first): float(at) for first, at in (line.split() for line in lines if " " in line)}


if __name__ == "__main__":
    note(Path(sys.argv.pop(1)))
    command_line()
