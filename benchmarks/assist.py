"""An operator who helps: nine identical fish, or a court, with flags, pointing, and what comes of it.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.assist --out out/bench

Clips of 20 seconds of fish that all look alike are drawn (Todor 2009, section 8.1) and tracked twice: alone,
and with a simulated operator at the screen who is shown one flag at a time, looks after a while, points at
where the fish really is with errors of a hand, and follows it until it is alone again. The picture that
they see is as late as MyView's is. Thresholds were chosen on clips of even seeds; those of odd seeds are
measured.
`--made-up` takes a school of boxes without pictures instead, of which there are many clips in little time.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import matplotlib as mpl
import matplotlib.pyplot as plt

from benchmarks.assist_cases import CAUSES, Cases, count
from benchmarks.assist_clips import Clip
from benchmarks.assist_drawn import Film, drawn
from benchmarks.assist_operator import Person
from benchmarks.assist_school import school
from benchmarks.assist_watch import FISH, PLAYERS, Watched, watch
from benchmarks.report import Report
from benchmarks.surroundings import CannotRunError, finish, parser
from server.camera.scene import scene_names

_SWEEP = (
    ("as a hand", Person()),
    ("points exactly", Person(error=0.0)),
    ("points badly: 2/3 of a body", Person(error=2.0 / 3.0)),
    ("quick: 0.2 s", Person(reaction_s=0.2)),
    ("slow: 1 s", Person(reaction_s=1.0)),
    ("picture not late", Person(delay_s=0.0)),
)
_FILMS = {
    "fish": (Film("fish", 9), FISH),
    "court": (Film("court", 10, fps=25.0, size=(640, 360)), PLAYERS),
}


def clips(options: argparse.Namespace) -> Iterator[Clip]:
    """Give the clips that are measured.

    Raises:
        CannotRunError: there is no such scene.
    """
    if options.made_up:
        make = partial(school, seconds=options.seconds)
    elif options.scene in scene_names():
        make = partial(drawn, replace(_FILMS[options.scene][0], seconds=options.seconds))
    else:
        raise CannotRunError(f"there is no scene {options.scene}; there are {', '.join(scene_names())}")
    for number in range(options.clips):
        yield make(2 * number + (0 if options.even else 1))


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    report, setup = Report(), _FILMS[options.scene][1]
    people = _SWEEP if options.sweep else _SWEEP[:1]
    pairs: dict[str, list[tuple[Watched, Watched]]] = {name: [] for name, _ in people}
    for clip in clips(options):
        alone = watch(clip, setup, None)
        for name, person in people:
            pairs[name].append((alone, watch(clip, setup, person)))
    found = {name: count(pairs[name], person) for name, person in people}
    _tell(report, found)
    name = f"assist-{'school' if options.made_up else options.scene}"
    _plot(found, options.out / f"{name}.png")
    report.save(options.out / f"{name}.txt")


def _tell(report: Report, found: dict[str, Cases]) -> None:
    first = next(iter(found.values()))
    report.say(f"{first.clips} clips, {first.minutes:.1f} minutes")
    report.table(
        "What helping is worth",
        ["operator", "flags/min", "failures", "foreseen", "with help", "avoided", "new", "saved"],
        [[name, *_row(cases)] for name, cases in found.items()],
    )
    for name, cases in found.items():
        report.table(f"Every flag and every failure: {name}", ["", "count"], _table(cases))


def _row(cases: Cases) -> list[str]:
    before, after = cases.unaided.total(), cases.left.total()
    return [
        f"{cases.flags_a_minute:.1f}",
        str(before),
        _share(cases.foreseen, before),
        str(after),
        str(cases.avoided),
        str(cases.made),
        _share(before - after, before),
    ]


def _share(part: int, whole: int) -> str:
    return f"{100.0 * part / whole:.0f} %" if whole else "-"


def _table(cases: Cases) -> list[list[str]]:
    flags, crossing = cases.flags, cases.crossings
    right = flags["helped"] + flags["not needed"]
    return [
        ["flagged, tracked rightly", str(right)],
        ["  crossings", str(crossing["helped"] + crossing["not needed"])],
        ["    the operator helped", str(crossing["helped"])],
        ["    was not needed: a false flag", str(crossing["not needed"])],
        ["  alone", str(right - crossing["helped"] - crossing["not needed"])],
        ["    the operator helped", str(flags["helped"] - crossing["helped"])],
        ["    was not needed: a false flag", str(flags["not needed"] - crossing["not needed"])],
        ["flagged, tracked wrongly", str(flags["harmed"] + flags["no help"])],
        ["  the operator harmed", str(flags["harmed"])],
        ["  could not help", str(flags["no help"])],
        ["failures with help", str(cases.left.total())],
        *([f"  {kind}", str(cases.kinds[kind])] for kind in ("2 way", "3 way", "alone")),
        *([f"  {cause}", str(cases.left[cause])] for cause in CAUSES),
    ]


def _plot(found: dict[str, Cases], path: Path) -> None:
    """Draw the failures without help, and with it by why they are left."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(8, 0.7 + 0.6 * (len(found) + 1)))
    names = ["nobody helps", *found]
    axes.barh(names[0], next(iter(found.values())).unaided.total(), color="0.6", label="without help")
    left = [0.0] * len(found)
    for cause, colour in zip(CAUSES, ("C0", "C1", "C2", "C3"), strict=True):
        counts = [cases.left[cause] for cases in found.values()]
        axes.barh(names[1:], counts, left=left, color=colour, label=cause)
        left = [before + more for before, more in zip(left, counts, strict=True)]
    axes.invert_yaxis()
    axes.set_xlabel("identity failures")
    axes.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Run the benchmark."""
    mpl.use("Agg")
    cv2.setNumThreads(1)
    options = parser(__doc__, "assist")
    options.add_argument("--scene", choices=_FILMS, default="fish", help="what is filmed")
    options.add_argument("--clips", type=int, default=56, help="how many")
    options.add_argument("--seconds", type=float, default=20.0, help="of each")
    options.add_argument("--even", action="store_true", help="the seeds that thresholds were chosen on")
    options.add_argument("--sweep", action="store_true", help="other operators, too")
    options.add_argument("--made-up", action="store_true", help="a school of boxes without pictures")
    options.add_argument("--quick", action="store_true", help="4 clips")
    chosen = options.parse_args()
    if chosen.quick:
        chosen.clips = min(chosen.clips, 4)
    try:
        measure(chosen)
    except CannotRunError as problem:
        finish(problem, "assist")


if __name__ == "__main__":
    main()
