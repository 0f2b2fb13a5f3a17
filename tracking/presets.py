"""Sets of costs that belong together."""

from __future__ import annotations

from tracking.costs import CostSettings

PAPER_COSTS = CostSettings(
    appearance=0.5,
    displacement=0.01,
    displacement_unit="pixels",
    confidence=0.0,
    leave=0.0,
    course=0.0,
    comeback=0.0,
    gate=None,
    occlusion=0.5,
    unknown=0.0,
    conflict_rule="corners",
)
"""The costs as paper II.B has them, in pixels of a CIF picture (the defaults are free of its size)."""
