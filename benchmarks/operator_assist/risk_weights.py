"""Learn how likely what is foreseen goes wrong: the weights of `tracking/interactive/risk.py`.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.operator_assist.risk_weights --out out/bench

Schools without pictures of even seeds are tracked with nobody at the screen. Their failures are about as
rare as the thesis's; drawn fish and players fail so often that nearly every trouble goes wrong, and tell
nothing apart. A trouble went wrong where an identity failure of one of its tracks followed that an operator
who had been asked could have seen happen. Of each reason, the log odds of that are a weighted sum of the
trouble's signs, by the likelihood with a small ridge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from benchmarks.common.environment import parser
from benchmarks.common.report import Report
from benchmarks.operator_assist.assisted_tracking import TrackedClip, watch
from benchmarks.operator_assist.clip_kinds import kinds
from benchmarks.operator_assist.flag_outcomes import tells
from benchmarks.operator_assist.simulated_operator import OperatorProfile
from tracking.boxes import Floats
from tracking.interactive import RiskFeatures, RiskReason

_MARGIN, _GONE = 4.0, 5
"""What is foreseen here: more than anybody would be asked about, so that the risk of that is known, too."""
_RIDGE = 1.0
_STEPS = 50


def fitted(terms: Floats, wrong: Floats) -> Floats:
    """Return the weights of a logistic regression of `wrong` (N,) on `terms` (N, D), by Newton's method."""
    weights = np.zeros(terms.shape[1])
    for _ in range(_STEPS):
        chance = 1.0 / (1.0 + np.exp(-(terms @ weights)))
        slope = terms.T @ (wrong - chance) - _RIDGE * weights
        curve = (terms.T * (chance * (1.0 - chance))) @ terms + _RIDGE * np.eye(len(weights))
        weights += np.linalg.solve(curve, slope)
    return weights


def examples(watched: Sequence[TrackedClip], reason: RiskReason) -> tuple[Floats, Floats]:
    """Return the terms `(N, D)` of the troubles of a reason, and 1 where they went wrong `(N,)`."""
    rows, wrong, person = [], [], OperatorProfile()
    for it in watched:
        for newest, trouble in it.troubles:
            if trouble.reason == reason:
                rows.append(
                    RiskFeatures(trouble.margin, trouble.frame - newest, trouble.length).regression_terms
                )
                told = [tells(trouble, newest, failure, it.clip.fps, person) for failure in it.failures]
                wrong.append(float(any(told)))
    return np.array(rows).reshape(-1, len(RiskFeatures(0.0, 0.0, 0.0).regression_terms)), np.array(wrong)


def main() -> None:
    """Learn, and print."""
    options = parser(__doc__, "operator_assist.risk_weights")
    options.add_argument("--clips", type=int, default=50, help="how many")
    chosen = options.parse_args()
    kind = kinds()["school"]
    assist = replace(kind.setup.assist, swap_margin=_MARGIN, crossing_margin=_MARGIN, hidden_frames=_GONE)
    setup = replace(kind.setup, assist=assist)
    watched = [watch(clip, setup) for clip in kind.clips(chosen.clips, first=0)]
    table = []
    for reason in get_args(RiskReason):
        terms, wrong = examples(watched, reason)
        if not len(wrong):
            continue
        weights = [f"{it:.2f}" for it in fitted(terms, wrong)]
        table.append([reason, str(len(wrong)), f"{100.0 * wrong.mean():.0f} %", *weights])
    report = Report()
    report.say(f"{len(watched)} clips, {sum(it.clip.minutes for it in watched):.1f} minutes")
    report.table(
        "What risks are told from",
        ["reason", "troubles", "went wrong", "constant", "margin", "ahead", "lead / 10", "log(1 + length)"],
        table,
    )
    report.save(chosen.out / "operator_assist-risk.txt")


if __name__ == "__main__":
    main()
