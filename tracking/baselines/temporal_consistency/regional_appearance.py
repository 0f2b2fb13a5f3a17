"""How somebody looks in each part of the room: up to nine histograms (section 3.2; Krumm et al. 2000)."""

from __future__ import annotations

import numpy as np

from tracking.baselines.temporal_consistency.color_histogram import mismatch
from tracking.boxes import Floats


class Places:
    """One person's histograms, each with the place where it was taken."""

    def __init__(self, parts: int, size: tuple[int, int]) -> None:
        """Begin with none; `size` is that of the picture (width, height), `parts` are on each side of it."""
        self._parts, self._size = parts, np.array(size, dtype=np.float64)
        self._looks: dict[tuple[int, int], tuple[Floats, Floats]] = {}

    def __len__(self) -> int:
        return len(self._looks)

    def learn(self, middle: Floats, colours: Floats) -> None:
        """Take in how the person looks at a place `(2,)`; what was known of that part of the room goes."""
        across, down = np.clip((middle / self._size * self._parts).astype(int), 0, self._parts - 1).tolist()
        self._looks[across, down] = middle.copy(), colours

    def costs(self, middles: Floats, colours: Floats, unknown: float) -> Floats:
        """Say how unlike the person blobs are: middles `(B, 2)`, colours `(B, 64)` give `(B,)`.

        Each is compared with the histogram that was taken nearest to it.
        """
        if not self._looks:
            return np.full(len(middles), unknown)
        taken = np.stack([place for place, _ in self._looks.values()])
        models = np.stack([model for _, model in self._looks.values()])
        nearest = np.square(middles[:, None] - taken).sum(axis=-1).argmin(axis=1)
        return mismatch(colours, models[nearest])
