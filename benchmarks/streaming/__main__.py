"""Streaming: cost of splices and viewers, compared with re-encoding and nginx; frame correctness; a plot.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.streaming --out out/bench

Four cameras of 352x288 at 25 a second, about 500 kbit/s each: real H.264 of the synthetic room, and
simulated trackers of a hall with some sixty people. Bus, pulses, the best-view process and its sockets are
real; viewers are another process. `--part` selects measurements.
"""

from __future__ import annotations

import argparse
import asyncio
import resource
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.streaming.bare_sockets import measure_bare_sends
from benchmarks.streaming.delay_drift import drift
from benchmarks.streaming.ffmpeg_and_nginx import ffmpeg_switching, hls_from_nginx, hls_from_service
from benchmarks.streaming.frame_correctness import check_frames
from benchmarks.streaming.hls_latency import hls_delays
from benchmarks.streaming.simulated_cameras import GOP, SITE, draw_room
from benchmarks.streaming.splice_cost import splice, transcode
from benchmarks.streaming.stalled_viewers import StallComparison, compare_stalled, describe_stalled
from benchmarks.streaming.stream_site import running, viewers
from benchmarks.streaming.tables import StreamMeasurements, describe, plot
from benchmarks.streaming.viewing_cost import first_pictures, step_up, watch_objects
from server.camera.encoder import AccessUnit

PARTS = ("splice", "objects", "viewers", "first", "frames", "drift", "hls", "stalled")
_OBJECTS = 50
_FILM_FRAMES = 50
"""Frames of each camera, looped."""
_HOUR_S = 3600
_COUNTS = (250, 500, 1000, 2000, 3000, 4000)
_QUICK_COUNTS = (100, 250)
_STALL_VIEWERS, _QUICK_STALL_VIEWERS = 1000, 100
"""Viewers, a tenth of which stall."""
_OTHER_FILES = 200
"""Open files that a process needs besides its viewers."""

Films = Sequence[Sequence[AccessUnit]]


def measure_parts(options: argparse.Namespace, films: Films, folder: Path) -> StreamMeasurements:
    """Measure the selected parts."""
    parts, quick = options.part or PARTS, options.quick
    found = StreamMeasurements()
    if "splice" in parts:
        found.transcoded = transcode(films[0], 5 if quick else 40)
        found.spliced = [
            asyncio.run(splice(films, objects, 20 if quick else 200)) for objects in (1, 10, _OBJECTS)
        ]
        found.ffmpeg = ffmpeg_switching(films, 100 if quick else 1000, folder)
    if "frames" in parts:
        found.correctness = asyncio.run(check_frames(1000 if quick else 10_000, 50 if quick else 500))
    if "drift" in parts:
        found.drift = asyncio.run(drift(films, round((60 if quick else _HOUR_S) * SITE.fps)))
    if "hls" in parts:
        found.hls_latency = asyncio.run(hls_delays(films, 6 if quick else 30))
    if {"objects", "viewers", "first"} & set(parts):
        _measure_site(options, parts, films, folder, found)
    return found


def measure_stalled(options: argparse.Namespace, films: Films, folder: Path) -> StallComparison:
    """Measure viewers of which a tenth stall."""
    _raise_file_limit()
    rounds = 2 if options.quick else options.rounds
    with running(films, folder / "stalled") as site, viewers(site.http) as crowd:
        numbers = site.objects(_OBJECTS)[:_OBJECTS]
        count = _QUICK_STALL_VIEWERS if options.quick else _STALL_VIEWERS
        return compare_stalled(site, crowd, numbers, count, options.seconds, rounds)


def _measure_site(
    options: argparse.Namespace, parts: Sequence[str], films: Films, folder: Path, found: StreamMeasurements
) -> None:
    """Measure the parts that need a running site."""
    quick, seconds = options.quick, options.seconds
    counts = options.viewers or (_QUICK_COUNTS if quick else _COUNTS)
    max_files = _raise_file_limit()
    with running(films, folder / "site") as site, viewers(site.http) as crowd:
        numbers = site.objects(_OBJECTS)[:_OBJECTS]
        if "objects" in parts:
            found.watched = watch_objects(site, crowd, numbers, films[0], seconds, 1 if quick else 5)
        if "first" in parts:
            crowd.watch([f"/objects/{number}/best.mp4" for number in numbers])
            found.first_pictures_ms = first_pictures(site, numbers, 30 if quick else 300)
        if "viewers" in parts:
            found.service_hls = hls_from_service(site, numbers[0], seconds)
            found.nginx_hls = hls_from_nginx(site, numbers[0], seconds, folder / "nginx")
            found.beyond_file_limit = [count for count in counts if count + _OTHER_FILES > max_files]
            possible = [count for count in counts if count + _OTHER_FILES <= max_files]
            found.steps = step_up(site, crowd, numbers, possible, seconds)
            crowd.watch([])
            found.bare = measure_bare_sends(films[0], max(possible), seconds) if possible else None


def _raise_file_limit() -> int:
    """Raise the limit of open files of this process and its children to the maximum; return it."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    return hard


def measure(options: argparse.Namespace) -> None:
    """Run the measurements; print and save the tables."""
    options.out.mkdir(parents=True, exist_ok=True)
    report = Report()
    films = draw_room(_FILM_FRAMES)
    kbits = np.mean([8 * len(unit.data) for film in films for unit in film]) * SITE.fps / 1e3
    report.line(f"4 cameras of {SITE.width}x{SITE.height}, GOPs of {GOP}, {kbits:.0f} kbit/s on average")
    with tempfile.TemporaryDirectory(prefix="myview-stream-") as temporary:
        found = measure_parts(options, films, Path(temporary))
        stalled = (
            measure_stalled(options, films, Path(temporary)) if "stalled" in (options.part or PARTS) else None
        )
    describe(report, found)
    if stalled is not None:
        describe_stalled(report, stalled)
    if found.steps:
        plot(found, options.out / "streaming.png")
    report.save(options.out / "streaming.txt")


def main() -> None:
    """Read the command line and run."""
    options = parser(__doc__, "streaming")
    options.add_argument("--part", action="append", choices=PARTS, help="only this one; may be repeated")
    options.add_argument("--quick", action="store_true", help="smaller counts and shorter runs")
    options.add_argument(
        "--viewers", type=int, action="append", help="number of simultaneous viewers; may be repeated"
    )
    options.add_argument("--seconds", type=float, default=8.0, help="per measurement of a running site")
    options.add_argument("--rounds", type=int, default=8, help="rounds with and without stalled viewers")
    measure(options.parse_args())


if __name__ == "__main__":
    main()
