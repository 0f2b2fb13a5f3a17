"""The costs behind each selected view, computed on request."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview import NO_CAMERA
from bestview.quality import QualitySettings
from server.service.view_selection.lookahead_window import LookaheadPart

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ViewExplanation:
    """One camera's view of one person over the look-ahead."""

    cost: float | None
    """Mean cost of a frame; None: it cannot be shown."""
    seen: float
    """Share of the frames in which the camera detects the person."""
    quality: float | None
    """Mean quality over these frames; None: there are none."""
    terms: dict[str, float]
    """Mean of each quality term with a weight; empty: there are none."""
    undetected: float
    """Share of the frames in which it does not detect the person, whom other cameras locate in its view."""
    undetected_quality: float | None
    """Mean inferred quality of those views; None: there are none."""


@dataclass(frozen=True, slots=True)
class ViewCostExplanation:
    """The costs of one person's views, in frames without the person."""

    frames: int
    """Frames of the look-ahead."""
    views: dict[str, ViewExplanation]
    """By camera."""
    weights: dict[str, float]
    """By term: the share of a view's quality that is lost where the term is at its worst."""
    stay: float | None
    """The cost with the camera of the GOP before; None: none, or it cannot be shown."""
    cut: float | None
    """The cost with the best other camera, `switch_cost` included; None: there is none."""
    cut_to: str | None
    """That camera."""
    switch_cost: float


@dataclass(frozen=True, slots=True, eq=False)
class GopExplanation:
    """The costs by which the views of one GOP were selected.

    Attributes:
        part: the look-ahead.
        before: (K,) the camera of the GOP before, by index; -1: none.
        weight: (N,) of each frame of the look-ahead.
        switch_cost: the cost of a cut, in frames without the person.
        settings: the weights of the terms.
    """

    part: LookaheadPart
    before: Ints
    weight: Floats
    switch_cost: float
    settings: QualitySettings

    def of(self, number: int) -> ViewCostExplanation:
        """Explain one person's view.

        Raises:
            KeyError: the GOP was not decided for this person.
        """
        views, cameras = self.part.views(number), self.part.window.cameras
        columns = self.part.window.views.camera[views]
        undetected = self.part.undetected(number)
        undetected_columns = self.part.window.undetected.camera[undetected]
        costs = self.part.frame_costs(number)
        cost, mean = (costs * self.weight[:, None]).sum(axis=0), costs.mean(axis=0)
        before = int(self.before[self.part.numbers == number][0])
        stay = np.inf if before == NO_CAMERA else cost[before]
        other = np.where(np.arange(len(cost)) == before, np.inf, cost)
        best = int(np.argmin(other))
        cut = other[best] + (0.0 if before == NO_CAMERA else self.switch_cost)
        return ViewCostExplanation(
            frames=self.part.frames,
            views={
                name: self._view(
                    views[columns == index], undetected[undetected_columns == index], mean[index]
                )
                for index, name in enumerate(cameras)
            },
            weights={name: self.settings.weights[name] for name in self.settings.terms},
            stay=_finite(stay),
            cut=_finite(cut),
            cut_to=cameras[best] if np.isfinite(cut) else None,
            switch_cost=self.switch_cost,
        )

    def _view(self, views: Ints, undetected: Ints, mean: float) -> ViewExplanation:
        """Explain one camera's view, by the indices of its detected and of its inferred views."""
        window = self.part.window
        terms = [window.terms(int(view)) for view in views]
        return ViewExplanation(
            cost=_finite(mean),
            seen=len(views) / self.part.frames,
            quality=float(np.mean(window.quality[views])) if terms else None,
            terms=dict(zip(self.settings.terms, np.mean(terms, axis=0).tolist(), strict=True))
            if terms
            else {},
            undetected=len(undetected) / self.part.frames,
            undetected_quality=float(np.mean(window.undetected.quality[undetected]))
            if undetected.size
            else None,
        )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
