"""From a fresh clone to the first picture: the time of `make demo`, step by step; a plot.

    python -m benchmarks.startup --out out/bench

Clones the committed tree into a temporary folder, where nothing is installed. Packages come from the index or
from the caches of pip and uv; `tests/bare_machine.sh` runs without caches.
"""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.common.environment import ROOT, parser
from benchmarks.common.report import Report

_TIMEOUT_S = 600.0
_ANSI = re.compile(r"\x1b\[[0-9;]*m")


@dataclass(frozen=True, slots=True)
class Milestone:
    """A line of the output that ends a step."""

    step: str
    line: re.Pattern[str]
    times: int = 1
    """How often the line must appear."""


MILESTONES = (
    Milestone("make the virtual environment", re.compile(r"pip install .*\buv$")),
    Milestone("install uv", re.compile(r"uv pip install")),
    Milestone("install dependencies", re.compile(r"^\S*myview demo$")),
    Milestone("start the demo", re.compile(r"^Three cameras at")),
    Milestone("start the best-view service: the page answers", re.compile(r"page, streams and API on")),
    Milestone("start the cameras", re.compile(r"camera c\d connected"), 3),
    Milestone("detect and show a person", re.compile(r"^MyView is ready")),
)


@dataclass(frozen=True, slots=True)
class StartupStep:
    """How long a step took, and when it ended."""

    name: str
    seconds: float
    done_after: float


def measure(clone: Path) -> list[StartupStep]:
    """Run `make demo` in a fresh clone until it shows a person; return the time of every step.

    Raises:
        RuntimeError: the demo ended before that.
    """
    steps: list[StartupStep] = []
    output: list[str] = []
    began = last = time.monotonic()
    with _demo(clone) as lines:
        pending = list(MILESTONES)
        matches = 0
        for line in lines:
            output.append(_ANSI.sub("", line).rstrip())
            matches += bool(pending[0].line.search(output[-1]))
            if matches >= pending[0].times:
                now = time.monotonic()
                steps.append(StartupStep(pending.pop(0).step, now - last, now - began))
                last, matches = now, 0
            if not pending:
                return steps
    raise RuntimeError("`make demo` ended before it was ready:\n" + "\n".join(output[-20:]))


@contextlib.contextmanager
def _demo(clone: Path) -> Iterator[Iterator[str]]:
    """Run `make demo`; yield its output lines, and terminate it at the end."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "BROWSER": "true"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # else every process would compile all modules again
    process = subprocess.Popen(
        ["make", "demo"],
        cwd=clone,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    signal.signal(signal.SIGALRM, lambda *_: os.killpg(process.pid, signal.SIGTERM))
    signal.setitimer(signal.ITIMER_REAL, _TIMEOUT_S)
    try:
        yield iter(process.stdout or ())
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        process.communicate()


def plot(steps: Sequence[StartupStep], path: Path) -> None:
    """Draw a bar for every step, each starting where the previous one ended."""
    figure = Figure(figsize=(8, 3), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    names = [step.name for step in steps]
    axes.barh(
        names, [step.seconds for step in steps], left=[step.done_after - step.seconds for step in steps]
    )
    axes.invert_yaxis()
    axes.set_xlabel("seconds since `make demo`")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def main() -> None:
    """Run the benchmark."""
    chosen = parser(__doc__ or "", "startup").parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # through `_demo`, which ends the site
    report = Report()
    with tempfile.TemporaryDirectory(prefix="myview-startup-") as folder:
        clone = Path(folder) / "clone"
        subprocess.run(["git", "clone", "--quiet", "--local", str(ROOT), str(clone)], check=True)
        steps = measure(clone)
    rows = [[step.name, f"{step.seconds:.1f}", f"{step.done_after:.1f}"] for step in steps]
    report.table("From a fresh clone to the first picture, seconds", ["step", "took", "done after"], rows)
    plot(steps, chosen.out / "startup.png")
    report.save(chosen.out / "startup.txt")


if __name__ == "__main__":
    main()
