"""The papers' presets: segments, initiation, rows and costs as written there."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest

from tracking import PAPER, PAPER_CVPR, CostSettings, Detections, OnlineTracker, create_solver
from tracking.model.network import Template, build_network

FPS = 25.0


@pytest.mark.parametrize(("frames", "segments"), [(1351, 75), (2431, 135)])
def test_segments_overlap_in_the_templates_frame(frames: int, segments: int) -> None:
    window = PAPER.window.resolve(FPS)
    assert window.window == window.stride
    assert (frames - 1) / window.stride == segments


@pytest.mark.parametrize("frames", [12, 18, 20, 40])
def test_a_new_object_is_visible_in_more_than_three_quarters_of_a_segment(frames: int) -> None:
    preset = PAPER.with_segments(frames)
    box = np.array([[100.0, 50.0, 120.0, 110.0]])
    for visible in (3 * frames // 4, 3 * frames // 4 + 1):
        tracker = OnlineTracker(preset.window, preset.costs, create_solver("columns"), FPS)
        for frame in range(frames):
            count = int(frame >= frames - visible)
            result = tracker.push(frame, Detections(box[:count], np.ones(count), np.ones((count, 1))))
        assert result is not None
        assert len(result.tracks) == int(visible > 0.75 * frames)


def test_rules_and_rows_are_the_papers_and_the_layout_term_is_on() -> None:
    costs = PAPER.costs
    assert (costs.conflict_rule, costs.conflict_rows) == ("corners", "star")
    assert costs.layout > 0.0
    assert costs.gate is None
    extensions = ("confidence", "disappearance", "motion", "reappearance", "unknown_appearance")
    assert {name: asdict(costs)[name] for name in extensions} == dict.fromkeys(extensions, 0.0)


def test_the_papers_differ_in_what_hiding_costs() -> None:
    frames = [Detections.empty(1)] * 2
    costs = replace(PAPER.costs, change=0.3, occlusion=0.5)
    journal, cvpr = (
        build_network([Template(1, np.ones(1), None)], frames, settings)
        for settings in (costs, replace(costs, occlusion_adds_change=False))
    )
    assert PAPER_CVPR.costs == replace(PAPER.costs, occlusion_adds_change=False)
    assert (journal.node[0, 0, -1], journal.sink[0, -1]) == pytest.approx((0.8, 0.8))
    assert (cvpr.node[0, 0, -1], cvpr.sink[0, -1]) == pytest.approx((0.5, 0.5))
    assert CostSettings().occlusion_adds_change
