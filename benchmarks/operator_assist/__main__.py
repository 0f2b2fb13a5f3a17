"""Operator assistance on nine identical fish, or a court: flags, pointing, and the remaining failures.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.operator_assist --out out/bench

Clips of 20 seconds of identical fish are rendered (Todor 2009, section 8.1) and tracked twice: without help,
and with a simulated operator, who handles one flag at a time, reacts after a while, points at the true place
of the fish with the errors of a hand, and follows it until it is alone again. Their picture has MyView's
delay. Risk events become flags where a site would raise them. Risk weights were learned by
`python -m benchmarks.operator_assist.risk_weights` on clips of even seeds; clips of odd seeds are measured.

`--kind school` simulates a school of boxes without pictures, which is much faster; `--objects` sets the
number of fish.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import matplotlib as mpl
import matplotlib.pyplot as plt

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.operator_assist import outcome_table, recall_curve
from benchmarks.operator_assist.assisted_tracking import TrackedClip, track_by_states, track_clip
from benchmarks.operator_assist.clip_kinds import ClipKind, kinds
from benchmarks.operator_assist.flag_outcomes import CAUSES, OutcomeCounts, count
from benchmarks.operator_assist.flag_selection import FlagSelector
from benchmarks.operator_assist.simulated_operator import OperatorProfile
from server.config.sections import FlagSettings

_ANY = 600
"""Flags a minute: effectively unlimited."""
_SWEEP = (
    ("exact pointing", OperatorProfile(error=0.0)),
    ("bad pointing: 2/3 of a body", OperatorProfile(error=2.0 / 3.0)),
    ("quick: 0.2 s", OperatorProfile(reaction_s=0.2)),
    ("slow: 1 s", OperatorProfile(reaction_s=1.0)),
    ("no picture delay", OperatorProfile(delay_s=0.0)),
    ("no replay", OperatorProfile(back_s=0.0)),
)


def measure(options: argparse.Namespace) -> None:
    """Measure, print and save."""
    report, kind = Report(), kinds(options.objects, options.seconds)[options.kind]
    alone = [
        track_clip(clip, kind.setup) for clip in kind.clips(options.clips, first=0 if options.even else 1)
    ]
    points = recall_curve.curve(alone, OperatorProfile())
    by_states = recall_curve.curve(
        [track_by_states(result.clip, kind.setup) for result in alone], OperatorProfile()
    )
    few, any_number = (
        FlagSettings(per_minute=most, risk=options.risk) for most in (options.per_minute, _ANY)
    )
    people = [
        (f"{few.per_minute} flags a minute", OperatorProfile(), few),
        ("any number of flags", OperatorProfile(), any_number),
    ]
    if options.sweep:
        people += [(name, person, any_number) for name, person in _SWEEP]
    found = {
        name: count(_with_operator(alone, kind, person, flags), person) for name, person, flags in people
    }
    name = f"operator_assist-{options.kind}{options.objects or ''}"
    report.line(f"{len(alone)} clips, {points[0].minutes:.1f} minutes")
    report.table(
        "Failures foreseen by flags",
        ["risk from", "flags/min", "failures/min", "flags per failure", "foreseen", "upper bound"],
        recall_curve.rows(points),
    )
    report.table(
        "The thesis's state machine, with its own tracks, beside the swap margins",
        ["", "flags/min", "failures/min", "flags per failure", "foreseen", "upper bound"],
        [
            [name, *row[1:]]
            for name, found_points in (("state machine", by_states), ("margins, all", points))
            for row in recall_curve.rows(found_points[-1:])
        ],
    )
    _print_tables(report, found, thesis=options.kind != "court" and options.objects in {None, 9})
    recall_curve.plot(points, options.out / f"{name}-flags.png")
    _plot(found, options.out / f"{name}.png")
    report.save(options.out / f"{name}.txt")


def _with_operator(
    alone: list[TrackedClip], kind: ClipKind, person: OperatorProfile, flags: FlagSettings
) -> list[tuple[TrackedClip, TrackedClip]]:
    """Track the clips again, one after the other, with an operator."""
    selector = FlagSelector(flags, alone[0].clip.fps)
    return [(result, track_clip(result.clip, kind.setup, person, selector)) for result in alone]


def _print_tables(report: Report, found: dict[str, OutcomeCounts], *, thesis: bool) -> None:
    report.table(
        "Effect of the operator",
        ["operator", "flags/min", "failures", "foreseen", "with help", "avoided", "new", "saved"],
        [[name, *_row(outcome_counts)] for name, outcome_counts in found.items()],
    )
    for name, outcome_counts in found.items():
        title = f"All flags and failures: {name}"
        report.table(
            title, outcome_table.head(thesis=thesis), outcome_table.texts(outcome_counts, thesis=thesis)
        )


def _row(outcome_counts: OutcomeCounts) -> list[str]:
    before, after = outcome_counts.unaided.total(), outcome_counts.left.total()
    return [
        f"{outcome_counts.flags_a_minute:.1f}",
        str(before),
        _share(outcome_counts.foreseen, before),
        str(after),
        str(outcome_counts.avoided),
        str(outcome_counts.caused),
        _share(before - after, before),
    ]


def _share(part: int, whole: int) -> str:
    return f"{100.0 * part / whole:.0f} %" if whole else "-"


def _plot(found: dict[str, OutcomeCounts], path: Path) -> None:
    """Draw the failures without help, and with help by cause."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(8, 0.7 + 0.6 * (len(found) + 1)))
    names = ["no operator", *found]
    axes.barh(names[0], next(iter(found.values())).unaided.total(), color="0.6", label="without help")
    left = [0.0] * len(found)
    for cause, color in zip(CAUSES, (f"C{n}" for n in range(len(CAUSES))), strict=True):
        counts = [outcome_counts.left[cause] for outcome_counts in found.values()]
        axes.barh(names[1:], counts, left=left, color=color, label=cause)
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
    options = parser(__doc__, "operator_assist")
    options.add_argument("--kind", choices=kinds(), default="fish", help="kind of clips")
    options.add_argument(
        "--objects", type=int, help="number of fish or players; by default nine fish, ten players"
    )
    options.add_argument("--clips", type=int, default=56, help="how many")
    options.add_argument("--seconds", type=float, default=20.0, help="of each")
    options.add_argument("--per-minute", type=int, default=FlagSettings().per_minute, help="flags at most")
    options.add_argument(
        "--risk", type=float, default=FlagSettings().risk, help="from which a flag is raised"
    )
    options.add_argument("--even", action="store_true", help="the seeds that risk weights were learned on")
    options.add_argument("--sweep", action="store_true", help="other operators, too")
    options.add_argument("--quick", action="store_true", help="4 clips")
    chosen = options.parse_args()
    if chosen.quick:
        chosen.clips = min(chosen.clips, 4)
    measure(chosen)


if __name__ == "__main__":
    main()
