"""The command that runs the benchmarks one after the other: all (`make bench`), or those of `--only`.

    python -m benchmarks --only render --only latency

Each benchmark is also a command of its own, which is printed before its output. Plots and tables are
written into the folder `--out`.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from benchmarks.common.environment import ROOT, SKIPPED, one_thread_environment, parser


@dataclass(frozen=True, slots=True)
class Benchmark:
    """A benchmark that can be started by its module name."""

    name: str
    about: str
    arguments: tuple[str, ...] = ()

    def command(self, options: argparse.Namespace) -> list[str]:
        """Return the arguments of Python that run it."""
        common = ["--out", str(options.out), *self.arguments, "--data", str(options.data)]
        return ["-m", f"benchmarks.{self.name}", *common]


BENCHMARKS = (
    Benchmark("startup", "time from a fresh clone to the first picture, step by step; 1 minute"),
    Benchmark("render", "rendering speed of recordings, and processor time by stage"),
    Benchmark("latency", "delay from the pulse to the browser, by stage; 2 minutes"),
    Benchmark("latency.delay_modes", "what each choice of delay costs and gains; 5 minutes"),
    Benchmark("detectors", "precision, recall, calibration and tracks of detectors; 20 minutes"),
    Benchmark(
        "robustness",
        "disturbances of the pictures, and recovery from them; 20 minutes",
        ("--scene", "terrace", "--scene", "pets09", "--strength", "middle"),
    ),
    Benchmark("picture_condition", "seconds until a camera says that its lens is covered; 15 minutes"),
    Benchmark("blurring", "who is seen although people are blurred; 10 minutes"),
    Benchmark("rates", "frame rates from 2 to 60 a second; 40 minutes"),
    Benchmark("detectors.score_calibration", "fits the probabilities of installed networks; 10 minutes"),
    Benchmark("detectors.network_speed", "networks by provider and batch size, cameras of a GPU; 2 minutes"),
    Benchmark("other_trackers", "MyView and trackers from PyPI on public detections; 5 minutes"),
    Benchmark("baselines", "the survey's trackers beside the network program; 7 minutes"),
    Benchmark("temporal_consistency", "overhead view: identity errors after merges, pruning; 6 minutes"),
    Benchmark("survey_table", "the survey's Table 1, measured: occlusion, identity, real time; 10 minutes"),
    Benchmark(
        "ground_plane",
        "one program over all cameras on a floor beside a tracker in each; 30 minutes",
        ("--scene", "wildtrack true", "--scene", "wildtrack mild", "--scene", "wildtrack strong"),
    ),
    Benchmark(
        "ground_plane.growth", "time of joint tracking by stage up to 16 cameras of 60 people; 4 minutes"
    ),
    Benchmark("bestview", "identities and views beside simpler methods and ground truth; 20 minutes"),
    Benchmark(
        "operator_assist",
        "operator assistance on simulated schools of identical fish; 20 minutes",
        ("--kind", "school", "--clips", "28"),
    ),
    Benchmark(
        "operator_assist",
        "operator assistance on drawn fish that are detected in the pictures; 9 minutes",
        ("--kind", "fish", "--clips", "4"),
    ),
    Benchmark("operator_assist.play", "the thesis's soccer clips on drawn play and real people; 10 minutes"),
    Benchmark("ablation", "tracking scores without each cost term; 15 minutes"),
    Benchmark("layout_gain", "what a layout term could gain, and one between companions does; 40 minutes"),
    Benchmark("paper_experiments", "the paper's experiments, repeated on synthetic scenes; 35 minutes"),
    Benchmark("rtsp", "clients of the RTSP gateway, and what one sees when processes die; 8 minutes"),
    Benchmark("live_cameras", "real-time tracking of four live cameras, cost by stage; 2 minutes"),
    Benchmark("endurance", "memory and time over 50 000 frames; 10 minutes"),
    Benchmark("soak", "one hour of a whole site at 22 times the speed; 4 minutes", ("--hours", "1")),
    Benchmark("overload", "more cameras than the machine can handle, and recovery; up to 15 minutes"),
    Benchmark("overload.responsiveness", "response times of an overloaded site; 7 minutes"),
    Benchmark("calibration", "accuracy of cameras calibrated from walking people; 5 minutes"),
    Benchmark(
        "calibration.coincidence",
        "pairs of cameras that it keeps and refuses, rightly and wrongly; 6 minutes",
        ("--recording", "terrace"),
    ),
    Benchmark("scaling", "many simulated cameras on one best-view process; 4 minutes"),
    Benchmark("scaling.areas", "a site that is divided by area, over 1 to 8 services; 8 minutes"),
    Benchmark("streaming", "splicing, viewers and HLS delay, beside ffmpeg and nginx; 6 minutes"),
    Benchmark("substream", "processor time of a camera with and without a substream; 3 minutes"),
    Benchmark("codecs", "cost and size of H.264, VP8 and passthrough; 1 minute"),
    Benchmark("faults", "injected faults of processes, sources, messages, disk and clock; 12 minutes"),
    Benchmark("faults.failover", "failures of a site with two best-view services; 9 minutes"),
    Benchmark("faults.failover.swarm", "killed containers of a Swarm stack; needs Docker Engine; 6 minutes"),
    Benchmark("faults.restart", "restart of the best view, stage by stage; 3 minutes"),
    Benchmark("faults.containers", "injected faults of containers; needs Docker Engine; 10 minutes"),
    Benchmark("overlay", "cost of burnt-in boxes and JPEG; 1 minute"),
    Benchmark("page", "the page on the demo: switching people, memory over a visit; 4 minutes"),
    Benchmark("view_selection_speed", "time of view selection, and its growth; 1 minute"),
    Benchmark("solvers", "speed of the solvers of the tracking program; 3 minutes"),
)
_NAME_WIDTH = max(len(benchmark.name) for benchmark in BENCHMARKS)


def run(benchmark: Benchmark, options: argparse.Namespace) -> int:
    """Run a benchmark and return its exit code."""
    print(f"\n== {benchmark.name}: {benchmark.about}\n", flush=True)
    return subprocess.run(
        [sys.executable, *benchmark.command(options)], cwd=ROOT, env=one_thread_environment(), check=False
    ).returncode


def main() -> None:
    """List the benchmarks, run those selected, and print their results."""
    options = parser("Run the benchmarks.", "__main__")
    options.prog = "python -m benchmarks"
    names = list(dict.fromkeys(benchmark.name for benchmark in BENCHMARKS))
    options.add_argument("--only", action="append", choices=names, help="only this one; may be repeated")
    options.add_argument("--list", action="store_true", help="only list them")
    chosen = options.parse_args()
    chosen.out, chosen.data = Path.absolute(chosen.out), Path.absolute(chosen.data)
    for benchmark in BENCHMARKS:
        print(f"{benchmark.name:{_NAME_WIDTH}} {benchmark.about}")
    if chosen.list:
        return
    selected = [benchmark for benchmark in BENCHMARKS if not chosen.only or benchmark.name in chosen.only]
    codes = [(benchmark.name, run(benchmark, chosen)) for benchmark in selected]
    print()
    for name, code in codes:
        print(f"{name:{_NAME_WIDTH}} {_status(code)}")
    print(f"plots and tables are in {chosen.out}")
    sys.exit(any(code not in {0, SKIPPED} for _, code in codes))


def _status(code: int) -> str:
    if code == SKIPPED:
        return "skipped: a requirement is missing"
    return "done" if code == 0 else f"failed with exit code {code}"


if __name__ == "__main__":
    main()
