"""The real best-view process, which records when each GOP was sent, and how long that took.

    python -m benchmarks.streaming.timed_service TIMES bestview SITE.yaml

is `myview bestview SITE.yaml` with one method wrapped; nothing else is changed.
"""

from __future__ import annotations

import functools
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from server.cli.main import main as command_line
from server.service.streaming.splicer import Splicer
from server.service.view_selection.decider import GopDecision


def record_send_times(path: Path) -> None:
    """Write a line for each GOP: its first pulse, and when sending it began and ended."""
    original = Splicer.publish_decision
    times = path.open("a", encoding="ascii", buffering=1)

    @functools.wraps(original)
    def run(self: Splicer, decision: GopDecision) -> None:
        began = time.monotonic()
        original(self, decision)
        times.write(f"{decision.first} {began} {time.monotonic()}\n")

    Splicer.publish_decision = run  # type: ignore[method-assign]


@dataclass(frozen=True, slots=True)
class SendTimes:
    """When sending a GOP began, and when every viewer's socket had accepted it or was full."""

    began: float
    ended: float


def read(path: Path) -> dict[int, SendTimes]:
    """Return when each GOP was sent, by its first pulse."""
    lines = (line.split() for line in path.read_text(encoding="ascii").split("\n")[:-1])
    return {int(first): SendTimes(float(began), float(ended)) for first, began, ended in lines}


if __name__ == "__main__":
    record_send_times(Path(sys.argv.pop(1)))
    command_line()
