"""Weights of the terms of view quality (`view.quality`)."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class QualitySettings:
    """Weights of the terms: the largest share by which each can lower a view's quality, 0 to 1.

    0 leaves the term out; with ``size`` 1 and all others 0 the quality is the paper's (as a length).

    Raises:
        ValueError: a weight outside 0 to 1, or all of them 0.
    """

    size: float = 1.0  # how large the person is in the picture
    truncation: float = 1.0  # share of the person inside the picture
    occlusion: float = 0.25  # share of the person that other people do not cover
    centering: float = 0.0  # how near the person is to the middle of the picture
    sharpness: float = 0.0  # detail of the picture inside the box
    facing: float = 0.0  # walking towards the camera; needs a homography
    confidence: float = 0.0  # mean detection score of the track over its window, 0 where hidden
    relative: bool = True  # cost relative to the best view of the same frame; false: as in the paper

    def __post_init__(self) -> None:
        for name, weight in self.weights.items():
            if not 0.0 <= weight <= 1.0:
                raise ValueError(f"the weight {name} is a share between 0 and 1, not {weight}")
        if not any(self.weights.values()):
            raise ValueError("all weights are 0: every view would be as good as any other")

    @property
    def weights(self) -> dict[str, float]:
        """The weights by the terms' names, in the terms' order."""
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name != "relative"}

    @property
    def terms(self) -> tuple[str, ...]:
        """The terms with a weight above 0."""
        return tuple(name for name, weight in self.weights.items() if weight > 0)
