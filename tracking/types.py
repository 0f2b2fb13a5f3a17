"""Detections of one frame, and risk events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import BOX_SIDES


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """The detections of one frame: K hypotheses of where an object might be (paper II.A).

    Attributes:
        boxes: (K, 4) float64, `left, top, right, bottom` in pixels.
        scores: (K,) float64 in [0, 1], the detector's confidence.
        histograms: (K, B) float64, appearance; rows sum to 1. B = 0: unknown appearance.

    Raises:
        ValueError: the shapes do not fit together, or a number is not finite.
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
        for name in ("boxes", "scores", "histograms"):
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} are finite numbers: {self._first_wrong(name)}")

    def _first_wrong(self, name: str) -> str:
        rows = getattr(self, name).reshape(len(self), -1)
        wrong = int(np.argmin(np.isfinite(rows).all(axis=1)))
        return f"detection {wrong} has {rows[wrong].tolist()[:8]}"

    def __len__(self) -> int:
        return len(self.scores)

    @classmethod
    def empty(cls, bins: int) -> Detections:
        """Return no detections, with histograms of `bins` bins."""
        return cls(np.empty((0, BOX_SIDES)), np.empty(0), np.empty((0, bins)))


RiskReason = Literal["crossing", "id_switch", "track_loss", "optimality_gap"]
"""`crossing`: two similar objects are about to cross; `id_switch`: two may have swapped identities;
`track_loss`: an object's scores decline, or it stays occluded; `optimality_gap`: the solution is not proven
optimal."""

PictureCondition = Literal["clear", "covered", "turned", "blurred", "noisy", "frozen"]
"""What is wrong with a camera's picture. covered: something plain is before the lens; turned: another scene;
blurred: out of focus, or a film on the lens; noisy: noise as strong as the edges, as in the dark; frozen: the
same picture again and again."""


@dataclass(frozen=True, slots=True)
class RiskEvent:
    """A predicted identity failure. Consecutive windows repeat the same event.

    Attributes:
        reason: the kind of failure.
        objects: the ids of the one or two tracks concerned; the first is the one to correct.
        frame: the expected frame of the failure: the newest frame or later if it is predicted, within the
            window if it is possible already (`id_switch`: where the identities would separate). Images are
            displayed later than they are tracked, so it may still be ahead of the viewer.
        margin: the tracker's certainty, as a cost: 0 is undecided.
        length: frames for which the two overlap, or an object is occluded.
        risk: probability of the failure without a correction, in [0, 1]; comparable between reasons.
    """

    reason: RiskReason
    objects: tuple[int, ...]
    frame: int
    margin: float
    length: int
    risk: float
