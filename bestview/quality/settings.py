"""Weights of the terms of view quality (`view.quality`)."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class QualitySettings:
    """For each term, the largest share of a view's quality that it can take away: 0 to 1.

    0 leaves the term out; with ``size`` 1 and all others 0 the quality is the paper's (as a length).

    Raises:
        ValueError: a weight outside 0 to 1, or all of them 0.
    """

    size: float = 1.0  # how large the person is in the picture
    truncation: float = 1.0  # how much of the person the picture's edges leave
    occlusion: float = 0.25  # how much of the person other people leave to be seen
    centering: float = 0.0  # how near the middle of the picture
    sharpness: float = 0.0  # how much detail there is
    facing: float = 0.0  # walking towards the camera, not away from it; needs the ground
    confidence: float = 0.0  # how surely the track is there: mean score over its window, 0 where hidden
    relative: bool = True  # a view's cost is measured by the best view of the moment; false is the paper

    def __post_init__(self) -> None:
        for name, weight in self.weights.items():
            if not 0.0 <= weight <= 1.0:
                raise ValueError(f"the weight {name} is a share between 0 and 1, not {weight}")
        if not any(self.weights.values()):
            raise ValueError("all weights are 0: every view would be as good as any other")

    @property
    def weights(self) -> dict[str, float]:
        """The weights by the terms' names, in the terms' order."""
        return {it.name: getattr(self, it.name) for it in fields(self) if it.name != "relative"}

    @property
    def terms(self) -> tuple[str, ...]:
        """The terms with a weight above 0."""
        return tuple(name for name, weight in self.weights.items() if weight > 0)
