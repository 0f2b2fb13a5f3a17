"""Processor time of joint tracking by stage, and how it grows with cameras and people.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.ground_plane.growth --out out/bench

A simulated square, all of which every camera sees. Milliseconds of processor time per keyframe, of which
there are ten a second here, on boxes with noise; the exponents are those of the largest scene to half of it.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.ground_plane.square import FPS, SimulatedSquare
from benchmarks.ground_plane.stages import STAGES, timed_stages
from tracking import create_solver
from tracking.ground_plane import GroundPlaneTracker, GroundSettings

SIZES = ((4, 15), (4, 30), (4, 60), (8, 15), (8, 30), (8, 60), (16, 15), (16, 30), (16, 60))
_BEFORE = 24
"""Frames that are not counted: at first everybody may arrive."""
_RESOLUTION = 1e-3
"""Milliseconds."""


def measure_square(cameras: int, people: int, frames: int, solver: str) -> dict[str, float]:
    """Return the milliseconds per keyframe of each stage, and `tracks`, the people of the last frame."""
    square = SimulatedSquare(cameras, people)
    detections = list(square.frames(_BEFORE + frames))
    with timed_stages() as clock:
        tracker = GroundPlaneTracker(
            square.views, GroundSettings(), create_solver(solver), FPS, units_per_meter=1.0
        )
        for number, found in enumerate(detections):
            if number == _BEFORE:
                clock.restart()
            final = tracker.push(number, found)
            tracks = len(final[-1].tracks) if final else 0
    return {stage: 1e3 * clock.seconds[stage] / frames for stage in STAGES} | {"tracks": tracks}


def exponent_rows(times: Mapping[tuple[int, int], Mapping[str, float]]) -> list[list[str]]:
    """Return the growth exponents of each stage in people and in cameras, from half of the largest size."""
    cameras, people = max(times)
    rows = []
    for title, half in (("people", (cameras, people // 2)), ("cameras", (cameras // 2, people))):
        if half in times:
            larger, smaller = (_with_sum(times[size]) for size in ((cameras, people), half))
            exponents = [f"{math.log2(a / b):.1f}" for a, b in zip(larger, smaller, strict=True)]
            rows.append([f"exponent in {title}", "", *exponents, ""])
    return rows


def _with_sum(found: Mapping[str, float]) -> list[float]:
    """Return the milliseconds of each stage, not zero, and of all."""
    stages = [max(found[stage], _RESOLUTION) for stage in STAGES]
    return [*stages, sum(stages)]


def measure(options: argparse.Namespace) -> None:
    """Measure and print all sizes."""
    report = Report()
    times = {}
    for cameras, people in SIZES:
        if people <= options.most_people and cameras <= options.most_cameras:
            times[cameras, people] = measure_square(cameras, people, options.frames, options.solver)
    rows = [
        [
            str(cameras),
            str(people),
            *(f"{ms:.1f}" for ms in _with_sum(found)),
            f"{found['tracks']:.0f}",
        ]
        for (cameras, people), found in times.items()
    ]
    report.table(
        f"ms per keyframe, {options.frames} keyframes, solver {options.solver}",
        ("cameras", "people", *STAGES, "all", "tracks"),
        rows + exponent_rows(times),
    )
    report.save(options.out / "ground_plane_growth.txt")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__, "ground_plane.growth")
    options.add_argument("--frames", type=int, default=30, help="keyframes that are measured")
    options.add_argument("--most-people", type=int, default=60)
    options.add_argument("--most-cameras", type=int, default=16)
    options.add_argument("--solver", default="columns", help="of the joint program")
    measure(options.parse_args())


if __name__ == "__main__":
    main()
