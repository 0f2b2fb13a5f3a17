"""Sweep over look-ahead, switch cost and GOP length of view selection, on true boxes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.bestview.methods import visible_rows
from benchmarks.bestview.scenes import BenchmarkScene
from benchmarks.bestview.service_decisions import decide_with_true_ids
from benchmarks.common.report import Report
from bestview import NO_CAMERA, ViewScore, score_views, select_views
from server.cli.evaluate.choices_file import views_of
from server.cli.evaluate.ground_truth import SceneTruth
from server.config.sections import EncodeSettings, ViewSettings
from tracking.frame_rate import DEFAULT_FPS, frames_in

STRIDE = 5
"""Frames between two windows of the tracker: the default, for realistic delays."""
LOOKAHEADS = (10, 15, 25, 50, 100)
GOPS = (1, 5, 10, 25)
SWITCH_COSTS_S = (0.0, 0.1, 0.2, 0.3, 0.5, 1.0)
EXTRAPOLATE_S = (0.0, 0.25, 0.5, 1.0, 2.0)
QUICK_LOOKAHEADS, QUICK_GOPS, QUICK_SWITCH_COSTS_S = (10, 25), (1, 10), (0.1, 0.3)
QUICK_EXTRAPOLATE_S = (0.0,)
DEFAULT_LOOKAHEAD = frames_in(ViewSettings().lookahead_s, DEFAULT_FPS)
DEFAULT_GOP = EncodeSettings().frames_per_gop(DEFAULT_FPS)
DEFAULT_SWITCH_COST_S, DEFAULT_EXTRAPOLATE_S = ViewSettings().switch_cost_s, ViewSettings().extrapolate_s


@dataclass(frozen=True, slots=True)
class SweepSetting:
    """One setting of the sweep, in frames where no unit is named; look-ahead None: all is known."""

    lookahead: int | None
    gop: int
    switch_cost_s: float
    extrapolate_s: float = DEFAULT_EXTRAPOLATE_S

    def delay_s(self, fps: float) -> float:
        """Return the longest time from the first frame of a GOP to its decision, seconds."""
        return 0.0 if self.lookahead is None else (self.lookahead + STRIDE - 2) / fps


@dataclass(frozen=True, slots=True)
class SweepResult:
    """The score of a setting against the frame-exact optimum at the same switch cost."""

    setting: SweepSetting
    delay_s: float
    score: ViewScore


def settings_of(*, quick: bool) -> Iterator[SweepSetting]:
    """Yield the settings: look-ahead by GOP; then, at their defaults, switch cost and extrapolation."""
    gops = QUICK_GOPS if quick else GOPS
    for gop in gops:
        for lookahead in QUICK_LOOKAHEADS if quick else LOOKAHEADS:
            if lookahead >= gop:
                yield SweepSetting(lookahead, gop, DEFAULT_SWITCH_COST_S)
        yield SweepSetting(None, gop, DEFAULT_SWITCH_COST_S)
    for cost in QUICK_SWITCH_COSTS_S if quick else SWITCH_COSTS_S:
        if cost != DEFAULT_SWITCH_COST_S:
            yield SweepSetting(DEFAULT_LOOKAHEAD, DEFAULT_GOP, cost)
    for extrapolate_s in QUICK_EXTRAPOLATE_S if quick else EXTRAPOLATE_S:
        if extrapolate_s != DEFAULT_EXTRAPOLATE_S:
            yield SweepSetting(DEFAULT_LOOKAHEAD, DEFAULT_GOP, DEFAULT_SWITCH_COST_S, extrapolate_s)


def sweep(scene: BenchmarkScene, truth: SceneTruth, *, quick: bool) -> list[SweepResult]:
    """Score all settings."""
    fps = scene.config().site.fps
    rows = visible_rows(scene, truth)
    frames = truth.boxes.shape[1]
    results = []
    for setting in settings_of(quick=quick):
        switch_cost = setting.switch_cost_s * fps
        if setting.lookahead is None:
            views = _offline_optimum(truth, setting.gop, switch_cost)
        else:
            config = scene.config(
                encode={"gop_s": setting.gop / fps},
                track={
                    "window": {
                        "length_s": STRIDE / fps,
                        "stride_s": STRIDE / fps,
                        "birth_s": STRIDE / fps,
                        "min_frames": 3,
                    }
                },
                view={
                    "lookahead_s": setting.lookahead / fps,
                    "switch_cost_s": setting.switch_cost_s,
                    "extrapolate_s": setting.extrapolate_s,
                },
            )
            choices = decide_with_true_ids(config, rows, frames).choices
            same = {person: person for person in truth.people}
            views = views_of(choices, same, truth.people, truth.cameras, frames)
        score = score_views(truth.views.cost, truth.views.visible, views, switch_cost, fps)
        results.append(SweepResult(setting, setting.delay_s(fps), score))
    return results


def _offline_optimum(
    truth: SceneTruth, gop: int, switch_cost: float
) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    """Return the optimum with cuts at the first frames of GOPs only."""
    people, frames = truth.views.cost.shape[:2]
    starts = np.arange(frames) % gop == 0
    return select_views(truth.views.cost, np.full(people, NO_CAMERA), switch_cost, starts).views


def sweep_tables(report: Report, swept: Mapping[str, Sequence[SweepResult]]) -> None:
    """Print a table for each scene."""
    for name, results in swept.items():
        report.table(
            f"{name}, true boxes: look-ahead, GOP and switch cost",
            [
                "look-ahead",
                "GOP",
                "switch cost, s",
                "extrapolation, s",
                "delay, s",
                "Regret",
                "Visible",
                "Cuts",
                "Best",
            ],
            [
                [
                    "all" if result.setting.lookahead is None else str(result.setting.lookahead),
                    str(result.setting.gop),
                    f"{result.setting.switch_cost_s:g}",
                    f"{result.setting.extrapolate_s:g}",
                    "-" if result.setting.lookahead is None else f"{result.delay_s:.2f}",
                    *(f"{100 * share:.2f}" for share in (result.score.regret, result.score.visible)),
                    f"{result.score.cuts_per_minute:.1f}",
                    f"{result.score.optimum_cuts_per_minute:.1f}",
                ]
                for result in results
            ],
        )
