"""The plots of the best-view benchmark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.bestview.methods import MethodScores
from benchmarks.bestview.parameter_sweep import (
    DEFAULT_EXTRAPOLATE_S,
    DEFAULT_GOP,
    DEFAULT_LOOKAHEAD,
    DEFAULT_SWITCH_COST_S,
    SweepResult,
)
from server.cli.render.plots import new_figure, save_figure


def plot_methods(scores: Mapping[str, Sequence[MethodScores]], out: Path) -> None:
    """Draw joint IDF1, agreement and visibility of every method, a row for each scene."""
    most = max(len(outcomes) for outcomes in scores.values())
    figure = new_figure((12.0, 0.8 + (0.8 + 0.2 * most) * len(scores)))
    axes = figure.subplots(len(scores), 3, squeeze=False)
    for line, (name, outcomes) in zip(axes, scores.items(), strict=True):
        names = [outcome.name for outcome in outcomes]
        places = np.arange(len(names))[::-1]
        joint = [
            np.nan if outcome.tracks is None else 100 * outcome.tracks.joint.idf1 for outcome in outcomes
        ]
        columns = {
            "joint IDF1": joint,
            "agreement with the optimum": [100 * outcome.views.agreement for outcome in outcomes],
            "visible in the chosen view": [100 * outcome.views.visible for outcome in outcomes],
        }
        for axis, (title, values) in zip(line, columns.items(), strict=True):
            axis.barh(places, values, color="#2a7f3f")
            axis.set_xlim(0, 100)
            axis.set_ylim(-0.6, len(names) - 0.4)  # same range even where bars are missing
            axis.set_title(f"{name}: {title}, %", fontsize="small")
            axis.set_yticks(places, names if title == "joint IDF1" else [], fontsize="x-small")
    save_figure(figure, out)


def plot_sweeps(swept: Mapping[str, Sequence[SweepResult]], out: Path) -> None:
    """Draw regret over delay for each GOP, regret over the GOP, and cuts over the switch cost."""
    figure = new_figure((12.0, 0.8 + 3.0 * len(swept)))
    axes = figure.subplots(len(swept), 3, squeeze=False)
    for line, (name, scores) in zip(axes, swept.items(), strict=True):
        default_extrapolation = [
            score for score in scores if score.setting.extrapolate_s == DEFAULT_EXTRAPOLATE_S
        ]
        default_cost = [
            score for score in default_extrapolation if score.setting.switch_cost_s == DEFAULT_SWITCH_COST_S
        ]
        for gop in sorted({score.setting.gop for score in default_cost}):
            live = [
                score
                for score in default_cost
                if score.setting.gop == gop and score.setting.lookahead is not None
            ]
            line[0].plot(
                [score.delay_s for score in live],
                [100 * score.score.regret for score in live],
                "o-",
                label=f"GOP {gop}",
            )
        line[0].set_xlabel("delay, s")
        line[0].legend(fontsize="x-small")
        offline = [score for score in default_cost if score.setting.lookahead is None]
        line[1].plot(
            [score.setting.gop for score in offline], [100 * score.score.regret for score in offline], "o-"
        )
        line[1].set_xlabel("GOP, frames; whole recording known")
        for axis in line[:2]:
            axis.set_ylabel("regret, %")
        costs = sorted(
            (
                score
                for score in default_extrapolation
                if score.setting.gop == DEFAULT_GOP and score.setting.lookahead == DEFAULT_LOOKAHEAD
            ),
            key=lambda score: score.setting.switch_cost_s,
        )
        values = [cost.setting.switch_cost_s for cost in costs]
        line[2].plot(values, [cost.score.cuts_per_minute for cost in costs], "o-", label="MyView's choice")
        line[2].plot(values, [cost.score.optimum_cuts_per_minute for cost in costs], "s--", label="optimum")
        line[2].set_xlabel("switch cost, seconds without a view of the person")
        line[2].set_ylabel("cuts per minute")
        line[2].legend(fontsize="x-small")
        line[0].set_title(f"{name}, true boxes", fontsize="small")
    save_figure(figure, out)
