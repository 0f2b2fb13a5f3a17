"""Fault injection into real processes while viewers watch, measured against the promises.

    python -m benchmarks.faults --out out/bench
    python -m benchmarks.faults --fault "kill camera" --fault "freeze camera"

The site is `myview up` on three views of the synthetic room. Every picture carries the number of its camera
and frame, and every box the frame in which it was detected, so that wrong pictures and boxes are counted.
Columns:

* *reconnects*: how often the viewers' streams broke and were opened again;
* *gap, s*: the longest time without a fresh picture, minus the length of a GOP (a GOP arrives in one piece),
  and in brackets the same before the fault. If the viewers' server is killed: from its readiness to the next
  picture, and in brackets the whole gap;
* *wrong pictures*: of a camera other than that of the events, of a frame other than the pulse's, or
illegible;
  *unnamed* are those without an event, whose camera is unchecked: allowed only if the server is killed;
* *wrong boxes*: drawn on a picture of a frame other than that of the detection; *means* of several boxes,
  which trackers interpolate, carry no frame number and are not checked;
* *recorded*: GOPs that were shown but not recorded; files that do not play;
* *exit*: time and exit code of the slowest terminated process.

The picture of a network camera at a pulse is not known in advance. In the faults of a source, a picture is
wrong if it is older than the previous one, more than 2 s behind its pulse or half a second ahead, or not the
one that was recorded at this pulse; the lag is printed below the table. Boxes are checked as for all cameras:
the detector reads the number of the picture in which it detects them.

Processes fail one by one, and in pairs; *camera* is the one that most viewers are shown, and *camera+camera*
that and the next one. Messages are all that cameras send and receive, except pictures: tracks, states,
thumbnails, detections (for the other cameras), and an operator's corrections. The camera that returns after
an hour is away for 20 s only, until its retry interval is the longest, and its timestamps are an hour ahead.
"""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path

from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.faults.injection import (
    clock_steps,
    config_reload,
    full_disk,
    messages,
    page_server,
    processes,
    separate_processes,
    shutdown,
    sources,
)
from benchmarks.faults.outcomes.measurement import measure
from benchmarks.faults.outcomes.plots import draw
from benchmarks.faults.outcomes.promise_table import describe
from benchmarks.faults.site.fault_site import Fault

FAULTS: tuple[Fault, ...] = (
    *processes.FAULTS,
    *config_reload.FAULTS,
    *page_server.FAULTS,
    *separate_processes.FAULTS,
    *sources.FAULTS,
    *messages.FAULTS,
    *full_disk.FAULTS,
    *clock_steps.FAULTS,
    *shutdown.FAULTS,
)


def main() -> None:
    """Read the command line, run, print and draw."""
    options = parser(__doc__ or "", "faults")
    names = [fault.name for fault in FAULTS]
    options.add_argument("--fault", action="append", choices=names, help="only this one; may be repeated")
    options.add_argument("--list", action="store_true", help="only list them")
    chosen = options.parse_args()
    if chosen.list:
        print("\n".join(names))
        return
    faults = [fault for fault in FAULTS if not chosen.fault or fault.name in chosen.fault]
    report = Report()
    try:
        with tempfile.TemporaryDirectory() as folder:
            outcomes = asyncio.run(measure(faults, Path(folder), report))
    except CannotRunError as problem:
        finish(problem, "faults")
    describe(report, outcomes)
    report.save(chosen.out / "faults.txt")
    draw(outcomes, chosen.out / "faults.png")


if __name__ == "__main__":
    main()
