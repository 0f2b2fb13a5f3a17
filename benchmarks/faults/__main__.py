"""Faults, injected into real processes while viewers watch: against each promise, what was measured.

    python -m benchmarks.faults --out out/bench
    python -m benchmarks.faults --fault "kill camera" --fault "freeze camera"

The site is `myview up` on three views of the synthetic room. On every picture stands which camera it is of
and which frame, and in every box in which frame it was found, so that a picture of the wrong camera or
moment and a box on another picture than its own are counted, not assumed. Columns:

* *opened again*: how often the viewers' streams broke and were opened again;
* *fresh*: the longest time in which a viewer got no fresh picture, less the rhythm of GOPs (a GOP comes in
  one piece), and in brackets the same over the seconds before the fault; the look-ahead is in neither, since
  all that viewers see is later by it. Where the viewers' own server dies: from when it says that it is ready
  to the next picture, and in brackets all the time without;
* *wrong pictures*: of another camera than the events named, of another frame than the pulse, or not legible;
  *unnamed* are those of which no event was heard, so that their camera may be the wrong one: only where the
  server dies, and the events with it, is that let pass;
* *wrong boxes*: drawn on a picture of another frame than they were found in; *means* of several boxes, which
  trackers make where they saw nothing, do not say where they were found, and are not judged;
* *recorded*: GOPs that were shown and are not on the disk; files that do not play;
* *ended*: of processes that were told to end, the slowest and its exit code.

Which picture a network camera has at a pulse nobody knows beforehand. In the faults of a source, wrong is one
of its pictures that is older than the one before, is more than 2 s behind its pulse or half a second ahead,
or is not the one that was recorded of this pulse; how far behind they were stands below the table. Its boxes
are judged as all are: its detector reads in which picture it finds them.

Processes fail one by one, and any two of them at once; *camera* is the one that most viewers are shown, and
*camera+camera* the next one, too. Messages are all that cameras say and hear, but pictures: tracks, states,
small pictures of people, what they find (for the other cameras), and where an operator points. A camera that
comes back after an hour was away for 20 s, in which it comes to be tried as seldom as ever, and is an hour
ahead by its time stamps; the hour itself is not waited for.
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
