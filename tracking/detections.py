"""What a detector hands on: the hypotheses of one frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import BOX_SIDES


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """What was seen in one frame: K hypotheses of where an object might be (paper II.A).

    Attributes:
        boxes: (K, 4) float64, `left, top, right, bottom` in pixels.
        scores: (K,) float64 in [0, 1], how sure the detector is.
        histograms: (K, B) float64, appearance; rows sum to 1. B = 0: no appearance is known.

    Raises:
        ValueError: the shapes do not fit together.
    """

    boxes: NDArray[np.float64]
    scores: NDArray[np.float64]
    histograms: NDArray[np.float64]

    def __post_init__(self) -> None:
        count = len(self.scores)
        if self.boxes.shape != (count, BOX_SIDES):
            raise ValueError(f"{count} scores need boxes of shape ({count}, 4), not {self.boxes.shape}")
        if self.histograms.ndim != 2 or len(self.histograms) != count:  # noqa: PLR2004 — rows and bins
            raise ValueError(
                f"{count} scores need histograms of shape ({count}, B), not {self.histograms.shape}"
            )

    def __len__(self) -> int:
        return len(self.scores)

    @classmethod
    def empty(cls, bins: int) -> Detections:
        """Nothing was seen; histograms would have had `bins` bins."""
        return cls(np.empty((0, BOX_SIDES)), np.empty(0), np.empty((0, bins)))
