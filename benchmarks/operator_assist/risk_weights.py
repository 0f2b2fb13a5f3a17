"""Learn the risk weights of `tracking/interactive/risk.py`.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.operator_assist.risk_weights --out out/bench

Schools without pictures, of even seeds, are tracked without an operator. Their failures are about as rare as
the thesis's; drawn fish and players fail so often that nearly every risk event goes wrong, which separates
nothing. A risk event went wrong if an identity failure of one of its tracks followed late enough for an
operator. For each reason, the log odds of that are a weighted sum of the event's features, fitted by logistic
regression with a small ridge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.operator_assist.assisted_tracking import TrackedClip, track_clip
from benchmarks.operator_assist.clip_kinds import kinds
from benchmarks.operator_assist.flag_outcomes import is_about
from benchmarks.operator_assist.simulated_operator import OperatorProfile
from tracking.boxes import Floats
from tracking.interactive import RiskFeatures, RiskReason

_MARGIN, _GONE_S = 4.0, 0.2
"""Settings that report more risk events than by default, to learn the risk of those, too."""
_RIDGE = 1.0
_STEPS = 50


def fit_weights(terms: Floats, wrong: Floats) -> Floats:
    """Return the weights of a logistic regression of `wrong` (N,) on `terms` (N, D), by Newton's method."""
    weights = np.zeros(terms.shape[1])
    for _ in range(_STEPS):
        chance = 1.0 / (1.0 + np.exp(-(terms @ weights)))
        slope = terms.T @ (wrong - chance) - _RIDGE * weights
        curve = (terms.T * (chance * (1.0 - chance))) @ terms + _RIDGE * np.eye(len(weights))
        weights += np.linalg.solve(curve, slope)
    return weights


def examples(tracked_clips: Sequence[TrackedClip], reason: RiskReason) -> tuple[Floats, Floats]:
    """Return the features `(N, D)` of the risk events of a reason, and 1 where they went wrong `(N,)`."""
    rows, wrong, profile = [], [], OperatorProfile()
    for clip in tracked_clips:
        for newest, event in clip.risk_events:
            if event.reason == reason:
                rows.append(RiskFeatures(event.margin, event.frame - newest, event.length).regression_terms)
                is_about_failures = [
                    is_about(event, newest, failure, clip.clip.fps, profile) for failure in clip.failures
                ]
                wrong.append(float(any(is_about_failures)))
    return np.array(rows).reshape(-1, len(RiskFeatures(0.0, 0.0, 0.0).regression_terms)), np.array(wrong)


def main() -> None:
    """Learn and print the weights."""
    options = parser(__doc__, "operator_assist.risk_weights")
    options.add_argument("--clips", type=int, default=50, help="how many")
    chosen = options.parse_args()
    kind = kinds()["school"]
    assist = replace(kind.setup.assist, swap_margin=_MARGIN, crossing_margin=_MARGIN, hidden_s=_GONE_S)
    setup = replace(kind.setup, assist=assist)
    tracked_clips = [track_clip(clip, setup) for clip in kind.clips(chosen.clips, first=0)]
    table = []
    for reason in get_args(RiskReason):
        terms, wrong = examples(tracked_clips, reason)
        if not len(wrong):
            continue
        weights = [f"{weight:.2f}" for weight in fit_weights(terms, wrong)]
        table.append([reason, str(len(wrong)), f"{100.0 * wrong.mean():.0f} %", *weights])
    report = Report()
    report.line(f"{len(tracked_clips)} clips, {sum(clip.clip.minutes for clip in tracked_clips):.1f} minutes")
    report.table(
        "Risk weights",
        [
            "reason",
            "risk events",
            "went wrong",
            "constant",
            "margin",
            "ahead",
            "lead / 10",
            "log(1 + length)",
        ],
        table,
    )
    report.save(chosen.out / "operator_assist-risk.txt")


if __name__ == "__main__":
    main()
