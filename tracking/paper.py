"""The papers' tracker to the letter: one preset of costs, rows, segments and initiation for each paper.

What the papers leave open (weights, thresholds of a CIF image) is chosen here, once. What MyView does
otherwise is a setting that differs from these; `python -m benchmarks.ablation` has a row for each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from tracking.frame_rate import DEFAULT_FPS
from tracking.model.settings import PAPER_COSTS, CostSettings
from tracking.window import WindowSettings

_FOR_EVER = 1_000_000
_ANY = 1_000

SEGMENT_FRAMES = 18
"""Frames of a segment without the templates' frame, which is the last one of the segment before: 1351 frames
are 75 segments, and 2431 are 135 (IV.A)."""

MORE_THAN_75_PERCENT = 0.7501

LAYOUT = 0.0005
"""μ: cost of a jump of one side of a box by a pixel, for each pair of objects."""


@dataclass(frozen=True, slots=True)
class PaperPreset:
    """The settings of a paper.

    Attributes:
        costs: arcs, conflict rows and layout term (II.B to II.D).
        window: segments and initiation (II.E).
    """

    costs: CostSettings
    window: WindowSettings

    def with_segments(self, frames: int) -> PaperPreset:
        """Return the preset with segments of so many frames after the templates' frame."""
        seconds = frames / DEFAULT_FPS
        window = replace(self.window, length_s=seconds, stride_s=seconds, birth_s=seconds)
        return replace(self, window=window)


def _window(frames: int) -> WindowSettings:
    """Return segments that overlap in the templates' frame, no gating, and tracks that are never ended."""
    return WindowSettings(
        length_s=frames / DEFAULT_FPS,
        stride_s=frames / DEFAULT_FPS,
        birth_s=frames / DEFAULT_FPS,
        birth_min_visible=MORE_THAN_75_PERCENT,
        birth_min_score=0.0,
        birth_min_peak_score=0.0,
        birth_max_tests=_ANY,
        duplicate_overlap=1.0,
        forget_after_s=_FOR_EVER,
        max_objects=_ANY,
        template_memory_s=_FOR_EVER,
        gate_heights=_FOR_EVER,
        max_height_ratio=_FOR_EVER,
        max_interpolated_gap_s=0.0,
        reidentify_after_s=_FOR_EVER,
    )


PAPER = PaperPreset(replace(PAPER_COSTS, layout=LAYOUT), _window(SEGMENT_FRAMES))
"""IEEE Transactions on Multimedia, 2008."""

PAPER_CVPR = replace(PAPER, costs=replace(PAPER.costs, occlusion_adds_change=False))
"""CVPR 2007: an arc into an occlusion or into the sink costs c_b alone."""
