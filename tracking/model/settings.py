"""The settings of the network's costs (paper II.B)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from tracking.appearance import AppearanceMeasure
from tracking.frame_rate import DEFAULT_FPS

ConflictRule = Literal["corners", "overlap"]
ConflictRows = Literal["clique", "star"]
DisplacementUnit = Literal["pixels", "heights"]


_JITTER, _SPEED, _TOP_SPEED = 0.1, 1.0, 2.5
"""Heights by which the box of somebody who stands changes from frame to frame; heights per second of somebody
who walks, and who runs."""
# Pixels: a smaller gate was probably meant in heights.
_MIN_GATE_PIXELS = 2.0


@dataclass(frozen=True, slots=True)
class CostSettings:
    """Costs of paths through the network, and rules for conflicting places.

    An arc between two observations costs g(template, target) + λ1 g(from, to) + λ2 d(from, to); an arc
    out of an occlusion c_a + g(template, target); an arc into an occlusion or into the sink c_a + c_b, or c_b
    alone (`occlusion_adds_change`).

    Raises:
        ValueError: a weight is negative, or a gate or threshold is not positive.
    """

    # λ1: weight of the change of appearance between two frames; no unit (g is in [0, 1]).
    appearance: float = 0.25
    # λ2: weight of the displacement between two frames, 0.04 seconds apart; cost per displacement unit
    # (below).
    displacement: float = 2.0
    # Unit of displacement and gate: pixels of the image, or mean heights of the two boxes.
    displacement_unit: DisplacementUnit = "heights"
    # c_a: cost of a typical change of position and appearance between two frames.
    change: float = 0.3
    # c_b: above the appearance difference of one object to itself, below that of two objects.
    occlusion: float = 0.8
    # Whether an arc into an occlusion or into the sink costs c_a + c_b (the journal paper), or c_b alone (the
    # CVPR paper).
    occlusion_adds_change: bool = True
    # Cost of an observation of score 0, decreasing to 0 at score 1: a hypothesis without evidence costs
    # nearly as much as an occlusion. 0 is the paper.
    confidence: float = 0.7
    # Cost of an arc into an occlusion, once per occlusion. 0 is the paper.
    disappearance: float = 1.0
    # Largest cost of the distance from an object's predicted position, reached at
    # `motion_slack + motion_drift * elapsed seconds` heights. 0 is the paper.
    motion: float = 0.2
    motion_drift: float = 1.0
    # Weight of the square of that distance for arcs out of an occlusion, in units of
    # `motion_slack + reappearance_drift * elapsed seconds` heights; beyond there is no arc. 0 is the
    # paper: no limit.
    reappearance: float = 1.0
    reappearance_drift: float = 0.75
    # Largest appearance distance to the template at which an object reappears after an occlusion, 0 to 1.
    reappearance_max_distance: float = 0.5
    # Deviation from the predicted position that is measurement error, heights.
    motion_slack: float = 0.2
    # g of an unknown appearance: about the distance of an object to itself, so that the other costs weigh
    # the same with and without images.
    unknown_appearance: float = 0.3
    # How histograms are compared: g(.), in [0, 1].
    measure: AppearanceMeasure = "bhattacharyya"
    # Longest displacement within 0.04 seconds, in displacement units; None: any.
    gate: float | None = 0.6
    # μ: weight of the spatial layout term, cost per pixel of L1 change between two objects; 0 is off.
    layout: float = 0.0
    # When two boxes conflict: by the city-block distance of their corners, or by their overlap.
    conflict_rule: ConflictRule = "overlap"
    # Rule "corners": boxes conflict below this total city-block distance of the 4 corners, pixels.
    conflict_distance: float = 60.0
    # Rule "overlap": boxes conflict above this ratio of shared to average area.
    conflict_overlap: float = 0.5
    # "clique": no two objects hold conflicting boxes. "star" is exactly II.D: at most one path
    # passes through the conflict set of every box, even of an unused one; with three or more objects that
    # excludes more.
    conflict_rows: ConflictRows = "clique"

    def __post_init__(self) -> None:
        weights = (
            "appearance",
            "displacement",
            "change",
            "occlusion",
            "confidence",
            "disappearance",
            "motion",
            "reappearance",
            "unknown_appearance",
            "layout",
        )
        for name in weights:
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} must not be negative, not {getattr(self, name)}")
        if not min(self.motion_slack, self.motion_drift, self.reappearance_drift) > 0.0:
            raise ValueError("motion_slack, motion_drift and reappearance_drift must be positive")
        if self.gate is not None and not self.gate > 0.0:
            raise ValueError(f"gate must be positive, not {self.gate}")
        if self.gate is not None and self.displacement_unit == "pixels" and self.gate < _MIN_GATE_PIXELS:
            raise ValueError(f"a gate of {self.gate:g} pixels allows no motion: set a larger one, or none")
        if not self.conflict_distance > 0.0:
            raise ValueError(f"conflict_distance must be positive, not {self.conflict_distance}")
        if not self.conflict_overlap > 0.0:
            raise ValueError(f"conflict_overlap must be positive, not {self.conflict_overlap}")

    @property
    def hidden(self) -> float:
        """The cost of an arc into an occlusion or into the sink."""
        return self.change + self.occlusion if self.occlusion_adds_change else self.occlusion

    def for_fps(self, fps: float) -> CostSettings:
        """Return the settings for so many frames per second.

        People walk further between two frames that are further apart, while boxes jitter alike: displacements
        are weighed and limited by what both add up to. Pixels, the paper's unit, are left as they are.
        """
        if self.displacement_unit == "pixels" or fps == DEFAULT_FPS:
            return self
        scale = (_JITTER + _SPEED / fps) / (_JITTER + _SPEED / DEFAULT_FPS)
        gate = self.gate
        if gate is not None:
            longer = 1.0 / fps - 1.0 / DEFAULT_FPS
            gate = max(gate + _TOP_SPEED * longer, gate / 2.0)
        return replace(self, displacement=self.displacement / scale, gate=gate)


PAPER_COSTS = CostSettings(
    appearance=0.5,
    displacement=0.01,
    displacement_unit="pixels",
    confidence=0.0,
    disappearance=0.0,
    motion=0.0,
    reappearance=0.0,
    gate=None,
    occlusion=0.5,
    unknown_appearance=0.0,
    conflict_rule="corners",
    conflict_rows="star",
)
"""The costs and rows of paper II.B to II.D without layout term, in pixels of a CIF image (the defaults do not
depend on the image size). `tracking.paper` has the whole tracker."""
