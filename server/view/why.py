"""Why each view was chosen, in numbers: worked out when somebody asks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview import NO_CAMERA
from bestview.quality import QualitySettings
from server.view.outlook import Part

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ViewReason:
    """What one camera's view of one person is worth over the look-ahead."""

    cost: float | None
    """Mean cost of a frame; None: it cannot be shown."""
    seen: float
    """Share of the frames in which the camera sees the person."""
    quality: float | None
    """Mean over these; None: there are none."""
    terms: dict[str, float]
    """What the quality is made of: mean of each term that weighs something; empty where there are none."""


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why one person is shown by that camera. Costs are in frames of not seeing the person at all."""

    frames: int
    """Frames of the look-ahead."""
    views: dict[str, ViewReason]
    """By camera."""
    weights: dict[str, float]
    """Of the terms: the share of a view's worth that is lost where a term is at its worst."""
    stay: float | None
    """What the look-ahead costs with the camera of the GOP before; None: none, or it cannot be shown."""
    cut: float | None
    """What it costs with the best other camera, `switch_cost` included; None: there is none."""
    cut_to: str | None
    """That camera."""
    switch_cost: float


@dataclass(frozen=True, slots=True, eq=False)
class Why:
    """What one GOP's choices were made by.

    Attributes:
        part: the look-ahead.
        before: (K,) the camera of the GOP before, by index; -1: none.
        weight: (N,) for how many frames each frame of the look-ahead stands.
        switch_cost: what a cut costs, in frames of not seeing the person.
        settings: how the terms weigh.
    """

    part: Part
    before: NDArray[np.int64]
    weight: Floats
    switch_cost: float
    settings: QualitySettings

    def of(self, number: int) -> Explanation:
        """Explain one person's view.

        Raises:
            KeyError: the GOP was not decided for this person.
        """
        rows = np.flatnonzero(self.part.numbers == number)
        if not rows.size:
            raise KeyError(number)
        each = self.part.cost[int(rows[0])]
        cost, mean = (each * self.weight[:, None]).sum(axis=0), each.mean(axis=0)
        before = int(self.before[int(rows[0])])
        stay = np.inf if before == NO_CAMERA else cost[before]
        other = np.where(np.arange(len(cost)) == before, np.inf, cost)
        best = int(np.argmin(other))
        cut = other[best] + (0.0 if before == NO_CAMERA else self.switch_cost)
        return Explanation(
            frames=len(self.part.frames),
            views={
                name: self._view(number, place, mean[place]) for place, name in enumerate(self.part.cameras)
            },
            weights={name: self.settings.weights[name] for name in self.settings.terms},
            stay=_finite(stay),
            cut=_finite(cut),
            cut_to=self.part.cameras[best] if np.isfinite(cut) else None,
            switch_cost=self.switch_cost,
        )

    def _view(self, number: int, column: int, mean: float) -> ViewReason:
        """Look up what one camera had to say of a person."""
        frames = len(self.part.frames)
        quality, terms = [], []
        for row in self.part.frames:
            numbered = row[column]
            if numbered is None:
                continue
            window, place = numbered.frame.window, numbered.frame.place
            here = (numbered.numbers == number) & ~np.isnan(window.quality[place])
            if here.any():
                track = int(np.argmax(here))  # the first, as in the costs
                quality.append(window.quality[place, track])
                terms.append(window.terms[:, place, track])
        return ViewReason(
            cost=_finite(mean),
            seen=len(quality) / frames,
            quality=float(np.mean(quality)) if quality else None,
            terms=dict(zip(self.settings.terms, np.mean(terms, axis=0).tolist(), strict=True))
            if terms
            else {},
        )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
