"""Runs the benchmarks one after the other, all of them (`make bench`) or only some.

    python -m benchmarks --only render --only delay

Each is a command of its own, which is printed above what it prints; plots and tables go into a folder.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from benchmarks.surroundings import ROOT, SKIPPED, one_thread_environment, parser


@dataclass(frozen=True, slots=True)
class Benchmark:
    """One script."""

    name: str
    about: str
    arguments: tuple[str, ...] = ()
    shared: bool = True
    """It has the options that all have, and says its own command."""

    def command(self, options: argparse.Namespace) -> list[str]:
        """Return the command that runs it."""
        words = ["-m", f"benchmarks.{self.name}", "--out", str(options.out), *self.arguments]
        return [*words, "--data", str(options.data)] if self.shared else words


BENCHMARKS = (
    Benchmark("startup", "from a fresh clone to the first picture, part by part; 1 minute"),
    Benchmark("render", "how fast recordings are rendered, and where the processor time goes"),
    Benchmark(
        "delay", "from the pulse to the browser, stage by stage; 2 minutes, part of it drawing the scene"
    ),
    Benchmark("observations", "what detectors find, and what the tracker makes of it; 10 minutes"),
    Benchmark("peers", "MyView beside other trackers, which pip installs, on public detections; 5 minutes"),
    Benchmark("yardsticks", "the survey's trackers beside the network program; 7 minutes"),
    Benchmark("temporal", "from above: who is mistaken after a merge, and what pruning saves; 6 minutes"),
    Benchmark("table1", "the survey's comparison measured: occlusions, identities, real time; 10 minutes"),
    Benchmark(
        "bestview", "who is who and the best view, beside simpler ways and beside the truth; 20 minutes"
    ),
    Benchmark(
        "assist",
        "an operator helps to track identical fish, of which boxes are made up; 20 minutes",
        ("--kind", "school", "--clips", "28"),
    ),
    Benchmark(
        "assist",
        "the same of fish that are drawn, and found in the pictures; 9 minutes",
        ("--kind", "fish", "--clips", "4"),
    ),
    Benchmark("ablation", "what each term of the tracker brings; 15 minutes"),
    Benchmark("experiments", "the paper's experiments again, on synthetic scenes; 10 minutes"),
    Benchmark("live", "four live cameras: whether tracking keeps up, and what each stage costs; 2 minutes"),
    Benchmark("endurance", "memory and time over 50 000 frames; 10 minutes"),
    Benchmark("soak", "an hour of a whole site, 22 times as fast; 4 minutes (--hours 24)", ("--hours", "1")),
    Benchmark("load", "ever more cameras than the machine carries, and the way back; up to 15 minutes"),
    Benchmark("load.health", "far too many cameras: whether the site still answers; 7 minutes"),
    Benchmark("calibration", "cameras placed from nothing but people who walk; 5 minutes"),
    Benchmark("scaling", "many simulated cameras: what one best-view process carries; 4 minutes"),
    Benchmark("stream", "splices, viewers and their delay beside ffmpeg and nginx; 6 minutes"),
    Benchmark("codecs", "H.264, VP8 and a camera's own H.264: what pictures cost and weigh; 1 minute"),
    Benchmark("faults", "processes, sources, messages, disk and clock fail while viewers watch; 12 minutes"),
    Benchmark("faults.containers", "the like in containers, which takes a Docker Engine; 10 minutes"),
    Benchmark("overlay", "boxes burnt in and JPEG: what pictures cost; 1 minute"),
    Benchmark("page", "the page on the demo: switching people, memory over a visit; 4 minutes"),
    Benchmark("choice", "what choosing views costs, and how it grows; 1 minute"),
    Benchmark("solvers", "the solvers of the tracking program against each other; 3 minutes"),
)


def run(benchmark: Benchmark, options: argparse.Namespace) -> int:
    """Run one and give its exit code."""
    words = benchmark.command(options)
    print(f"\n== {benchmark.name}: {benchmark.about}\n", flush=True)
    if not benchmark.shared:
        print(f"$ OPENBLAS_NUM_THREADS=1 python {' '.join(words)}", flush=True)
    return subprocess.run(
        [sys.executable, *words], cwd=ROOT, env=one_thread_environment(), check=False
    ).returncode


def main() -> None:
    """List the benchmarks, run them, and say how it went."""
    options = parser("Run the benchmarks.", "__main__")
    options.prog = "python -m benchmarks"
    names = list(dict.fromkeys(benchmark.name for benchmark in BENCHMARKS))
    options.add_argument("--only", action="append", choices=names, help="only this one; may be repeated")
    options.add_argument("--list", action="store_true", help="only list them")
    chosen = options.parse_args()
    chosen.out, chosen.data = Path.absolute(chosen.out), Path.absolute(chosen.data)
    for benchmark in BENCHMARKS:
        print(f"{benchmark.name:10} {benchmark.about}")
    if chosen.list:
        return
    codes = [(it.name, run(it, chosen)) for it in BENCHMARKS if not chosen.only or it.name in chosen.only]
    print()
    for name, code in codes:
        print(f"{name:10} {_word(code)}")
    print(f"plots and tables are in {chosen.out}")
    sys.exit(any(code not in {0, SKIPPED} for _, code in codes))


def _word(code: int) -> str:
    if code == SKIPPED:
        return "left out: what it needs is not there"
    return "done" if code == 0 else f"failed with exit code {code}"


if __name__ == "__main__":
    main()
