"""A solved window with its network, solution and detections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.model.network import Network
from tracking.solvers.base import OCCLUDED, SolveReport
from tracking.types import Detections


@dataclass(frozen=True, slots=True, eq=False)
class SolvedWindow:
    """A solved window with its network and solution.

    Attributes:
        first: its first frame.
        ids: the tracks in the program, in the order of the network's objects.
        network: the solved network.
        states: `(n, M)`, -1 where occluded.
        detections: of its M frames.
        report: the solver's report.
        final_to: the last frame that becomes final with it.
        known_ids: all tracks, including those without an observation in the window.
        recent_boxes: `(k, T, 4)` pixels, the known tracks' boxes in the last T frames, NaN where occluded.
        known_histograms: `(k, B)`, their templates.
    """

    first: int
    ids: tuple[int, ...]
    network: Network
    states: NDArray[np.int64]
    detections: Sequence[Detections]
    report: SolveReport
    final_to: int
    known_ids: tuple[int, ...]
    recent_boxes: Floats
    known_histograms: Floats

    @property
    def last(self) -> int:
        """The newest frame."""
        return self.first + len(self.detections) - 1

    @property
    def track_scores(self) -> Floats:
        """Detection scores of the tracks, `(n, M)`, NaN where occluded."""
        scores = np.full(self.states.shape, np.nan)
        for m, detections in enumerate(self.detections):
            visible = self.states[:, m] != OCCLUDED
            scores[visible, m] = detections.scores[self.states[visible, m]]
        return scores
