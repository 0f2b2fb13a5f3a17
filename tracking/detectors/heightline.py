"""How tall people look where: on a flat floor a box's height is a straight line in its foot's y.

A pinhole camera `c` above a flat floor sees a person of height `p` as `h = p / c (y - horizon)` rows
tall: one slope for the whole picture. So the slope is about known before anybody is seen (people are
some 1.7 m, cameras hang at 1.5 to 6 m), and a few people who stand alone fix the rest.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tracking.boxes import Floats
from tracking.detectors.base import Mask
from tracking.detectors.isolated import isolated_people


@dataclass(frozen=True, slots=True)
class HeightLineSettings:
    """Learning the height line `h = slope * y + offset` from people who stand alone."""

    use: bool = True  # off: every height everywhere (the paper's box filters)
    least_samples: int = 10  # isolated people seen before the line is trusted
    most_samples: int = 1000  # the newest that are kept
    sample_every: int = 1  # frames between two looks for isolated people
    usual_slope: float = 0.65  # person's height over the camera's: what the slope is without evidence
    slope_spread: float = 0.18  # standard deviation of that
    least_height: float = 0.08  # smallest person, in picture heights, where people as small were seen alone
    tolerance: float = 0.15  # a hypothesis may be this share taller or smaller than the line says
    doubt: float = 1.0  # standard deviations of the line by which it may be taller or smaller besides
    most_scatter: float = 0.13  # median deviation, in heights, above which there is no line (stairs)


@dataclass(frozen=True, slots=True)
class HeightLine:
    """The expected box height `slope * y + offset` of a person whose foot is at row y.

    Its standard deviation is `sqrt(spread^2 + (slope_spread (y - centre))^2)`: the line is known best
    where people were seen.
    """

    slope: float
    offset: float
    centre: float = 0.0
    spread: float = 0.0
    slope_spread: float = 0.0
    smallest: float = 0.0
    """Nobody much smaller was seen: far beyond the people seen, the line says nothing."""

    def at(self, foot: Floats) -> Floats:
        """Give the expected heights, in the unit of `foot`."""
        return self.slope * foot + self.offset

    def doubt(self, foot: Floats) -> Floats:
        """Give the standard deviations of the expected heights, in the unit of `foot`."""
        return np.hypot(self.spread, self.slope_spread * (foot - self.centre))

    def in_cells(self, cell: float, margin: float) -> HeightLine:
        """Give the same line in cells of `cell` pixels, in a plane with `margin` cells added above."""
        return HeightLine(
            self.slope,
            self.offset / cell - self.slope * margin,
            self.centre / cell + margin,
            self.spread / cell,
            self.slope_spread,
            self.smallest / cell,
        )


class HeightLineLearner:
    """Collects isolated standing blobs as it goes and fits the line to them."""

    def __init__(self, settings: HeightLineSettings) -> None:
        self._settings = settings
        self._samples: deque[tuple[float, float]] = deque(maxlen=settings.most_samples)
        self._frames = 0
        self._fitted_on = 0
        self._seen = 0
        self.line: HeightLine | None = None

    def watch(self, foreground: Mask, visible: Mask, frames: int = 1) -> None:
        """Look at one frame's foreground `(H, W)`; `visible` is 0 where the picture is ignored.

        It stands for so many `frames` in a row.
        """
        self._frames += 1
        if not self._settings.use or self._frames % self._settings.sample_every:
            return
        for foot, height in isolated_people(foreground, visible):
            self._samples.extend([(foot, height)] * frames)
            self._seen += frames
        # Refit when the samples have grown by a tenth: early often, later seldom.
        if len(self._samples) >= self._settings.least_samples and self._seen >= 1.1 * self._fitted_on:
            self._fitted_on = self._seen
            self.line = fit_line(np.asarray(self._samples, dtype=np.float64), self._settings)


# One person gives a sample in every frame: so many of them are worth one independent one.
_ALIKE = 25.0
# Standard deviation of a sample, in heights: strides, tall and small people.
_NOISE = 0.08
# Deviation, in heights, from which a sample counts as no whole person, or two.
_WILD = 0.16
_ROUNDS = 5
# People may be this much smaller than the low quantile of those that were seen alone.
_SMALLER, _LOW = 0.8, 0.05
_SLOPES = np.linspace(-2.0, 2.0, 17)
_SAMPLES_A_SLOPE = 40


def fit_line(samples: Floats, settings: HeightLineSettings) -> HeightLine | None:
    """Fit the line to samples `(N, 2)` of foot and height, or give `None` where they fit none.

    The most likely line under Tukey's biweight, `N(usual_slope, slope_spread^2)` before the slope and
    nothing before the offset: the best of a grid of slopes first, so that no share of wild samples
    below a half leads astray, then a few rounds of reweighted least squares.
    """
    foot, height = samples.T
    slope, offset = _best_of_grid(foot, height, settings)
    precision = np.diag([1e-9, settings.slope_spread**-2])
    centre = float(foot.mean())
    for _ in range(_ROUNDS):
        deviation = (height - slope * foot - offset) / height
        weight = np.maximum(1.0 - (deviation / _WILD) ** 2, 0.0) ** 2
        if not weight.any():
            return None
        centre = float(np.average(foot, weights=weight))
        weight = weight / (_ALIKE * (_NOISE * height) ** 2)
        terms = np.stack([np.ones_like(foot), foot - centre])
        evidence = (terms * weight) @ terms.T + precision
        pull = (terms * weight) @ height + precision @ [0.0, settings.usual_slope]
        level, slope = (float(value) for value in np.linalg.solve(evidence, pull))
        offset = level - slope * centre
    scatter = float(np.median(np.abs(height - slope * foot - offset) / height))
    # Upright cameras see people grow towards the bottom of the picture; anything else is a misfit.
    if slope <= 0.0 or scatter > settings.most_scatter:
        return None
    # Nearly uncorrelated, as the feet are counted from their weighted mean.
    level_spread, slope_spread = np.sqrt(np.diag(np.linalg.inv(evidence)))
    smallest = _SMALLER * float(np.quantile(height[weight > 0.0], _LOW))
    return HeightLine(slope, offset, centre, float(level_spread), float(slope_spread), smallest)


def _best_of_grid(
    foot: npt.NDArray[np.float64], height: npt.NDArray[np.float64], settings: HeightLineSettings
) -> tuple[float, float]:
    """Give slope and offset of the line through one sample that most samples are close to."""
    slopes = settings.usual_slope + settings.slope_spread * _SLOPES
    through = np.linspace(0, len(foot) - 1, min(len(foot), _SAMPLES_A_SLOPE)).astype(np.int64)
    offsets = height[through] - slopes[:, None] * foot[through]
    deviation = (height - slopes[:, None, None] * foot - offsets[..., None]) / height
    loss = np.minimum((deviation / _WILD) ** 2, 1.0).sum(axis=-1) * (_WILD / _NOISE) ** 2 / _ALIKE
    best = int(np.argmin(loss + (_SLOPES**2)[:, None]))
    row, column = divmod(best, len(through))
    return float(slopes[row]), float(offsets[row, column])
