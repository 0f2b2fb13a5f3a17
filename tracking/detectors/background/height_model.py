"""Height model: on a flat floor a person's box height is linear in the foot's row.

A pinhole camera `c` above a flat floor sees a person of height `p` as `h = p / c (y - horizon)` rows
tall: one slope for the whole image. The slope is roughly known in advance (people are about 1.7 m tall,
cameras hang at 1.5 to 6 m), and a few isolated people determine the line. A floor calibrated in meters gives
the line in advance; this prior is strong enough that fragments and pairs of people in a crowd barely change
it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.detectors.background.isolated_people import (
    IsolatedPerson,
    SampleNoveltyFilter,
    find_isolated_people,
)
from tracking.detectors.base import Mask
from tracking.frame_rate import DEFAULT_FPS, frames_in


@dataclass(frozen=True, slots=True)
class HeightModelSettings:
    """Settings of the height model `h = slope * y + offset`, learned from isolated people."""

    enabled: bool = True  # false: all heights everywhere (the paper)
    min_samples: int = 3  # isolated people at different positions needed for the model
    max_samples: int = 1000  # newest samples kept
    sample_every_s: float = 0.04  # seconds between two samples
    prior_slope: float = 0.65  # person height over camera height: the slope without samples
    prior_slope_std: float = 0.18  # standard deviation of this slope
    min_height: float = (
        0.08  # smallest person, in image heights, once isolated people of that size were detected
    )
    tolerance: float = 0.15  # share by which a box may be taller or smaller than the model
    tolerance_std: float = 1.0  # standard deviations of the model allowed in addition
    max_scatter: float = 0.13  # median deviation, in heights, above which there is no model (stairs)


@dataclass(frozen=True, slots=True)
class FloorGeometry:
    """What the floor calibration implies about people's heights.

    Attributes:
        horizon: the image row of the horizon, where the expected height is 0.
        slope: rows of a person's height per row between foot and horizon; None: the floor is not metric.
    """

    horizon: float
    slope: float | None

    def scaled_by(self, scale: float) -> FloorGeometry:
        """Return the geometry in an image scaled by `scale`."""
        return FloorGeometry(self.horizon * scale, self.slope)

    def turned(self, matrix: Floats, width: float) -> FloorGeometry:
        """Return the geometry after a turn: a homography (3, 3) of an image so many pixels wide."""
        (x0, y0), (x1, y1) = (
            (mapped[:2] / mapped[2]).tolist()
            for mapped in (matrix @ [0.0, self.horizon, 1.0], matrix @ [width, self.horizon, 1.0])
        )
        share = (width / 2.0 - x0) / (x1 - x0)
        return FloorGeometry(y0 + share * (y1 - y0), self.slope)


@dataclass(frozen=True, slots=True)
class HeightModel:
    """The expected box height `slope * y + offset` of a person whose foot is at row y.

    Its standard deviation is `sqrt(level_std^2 + (slope_std (y - center))^2)`, smallest where samples were
    taken.
    """

    slope: float
    offset: float
    center: float = 0.0
    level_std: float = 0.0
    slope_std: float = 0.0
    min_height: float = 0.0
    """Smallest person expected: the model does not extrapolate far below the samples."""

    def expected_height(self, foot_rows: Floats) -> Floats:
        """Return the expected heights at foot rows, in the unit of `foot_rows`."""
        return self.slope * foot_rows + self.offset

    def height_standard_deviation(self, foot_rows: Floats) -> Floats:
        """Return the standard deviations of the expected heights at foot rows, in the unit of `foot_rows`."""
        return np.hypot(self.level_std, self.slope_std * (foot_rows - self.center))

    def in_cells(self, cell_pixels: float, top_margin_cells: float) -> HeightModel:
        """Return the model in cells of `cell_pixels`, in a plane with `top_margin_cells` added above."""
        return HeightModel(
            self.slope,
            self.offset / cell_pixels - self.slope * top_margin_cells,
            self.center / cell_pixels + top_margin_cells,
            self.level_std / cell_pixels,
            self.slope_std,
            self.min_height / cell_pixels,
        )


class HeightModelEstimator:
    """Estimates the height model online from isolated standing people.

    With a metric floor there is a model from the beginning.
    """

    def __init__(
        self,
        settings: HeightModelSettings,
        fps: float = DEFAULT_FPS,
        floor: FloorGeometry | None = None,
        rows: float = 0.0,
    ) -> None:
        """Start without samples; `rows` is the height of the image in which `floor` is given."""
        self._settings = settings
        self._sample_every = frames_in(settings.sample_every_s, fps)
        self._frame_s = 1.0 / fps
        self._prior = height_prior(settings, floor, rows)
        self._samples: deque[tuple[float, float]] = deque(maxlen=settings.max_samples)
        self._novelty_filter = SampleNoveltyFilter()
        self._frames = 0
        self._fitted_on = 0
        self._sample_count = 0
        self._max_people = 1
        self._has_known_people = False
        self.model: HeightModel | None = None
        if settings.enabled:
            self.model = self._prior.model

    @property
    def is_reliable(self) -> bool:
        """Return whether the model is reliable: from a metric floor, or from enough samples."""
        model = self.model
        if model is None or self._prior.model is not None:
            return model is not None
        return model.level_std <= _RELIABLE * (model.slope * model.center + model.offset)

    def observe(self, foreground: Mask, visible: Mask) -> None:
        """Add the isolated people of the next foreground `(H, W)`; `visible` is 0 in ignored areas."""
        self._frames += 1
        if self._frames % self._sample_every == 0:
            self.sample(foreground, visible, self._sample_every * self._frame_s)

    def sample(self, foreground: Mask, visible: Mask, represented_s: float) -> None:
        """Add the isolated people of a frame that represents so many seconds, as `observe` does."""
        if self._settings.enabled and not self._has_known_people:
            self._add_people(find_isolated_people(foreground, visible), represented_s)

    def observe_people(self, people: Sequence[IsolatedPerson], represented_s: float) -> None:
        """Add people of one frame that are more certain than blobs, in pixels of the image.

        From the first on they alone count. `represented_s`: the seconds that the frame represents.
        """
        if not self._settings.enabled or not (people or self._has_known_people):
            return
        if not self._has_known_people:
            self._has_known_people = True
            self._samples.clear()
            self._sample_count = self._fitted_on = 0
        self._add_people(people, represented_s)

    def _add_people(self, people: Sequence[IsolatedPerson], represented_s: float) -> None:
        self._max_people = max(self._max_people, len(people))
        weight = max(round(represented_s / _SAMPLE_S), 1)
        for person in self._novelty_filter.new_samples(people, represented_s):
            self._samples.extend([(person.foot_row, person.height)] * weight)
            self._sample_count += weight
        # Refit when the number of samples has grown by a tenth.
        if len(self._samples) >= self._settings.min_samples and self._sample_count >= 1.1 * self._fitted_on:
            self._fitted_on = self._sample_count
            samples = np.asarray(self._samples, dtype=np.float64)
            self.model = fit_height_model(samples, self._settings, self._prior, self._max_people)


# Seconds per sample of a walking person, and correlated samples that count as one independent sample.
_SAMPLE_S = 0.16
_CORRELATED_SAMPLES = 6.0
# Standard deviation of a sample, in heights: strides, missing parts of the outline.
_NOISE = 0.06
# Standard deviation of people's stature, in heights: common to all samples of a person.
_STATURE = 0.04
# Deviation, in heights, of an outlier: part of a person, or two people.
_OUTLIER = 0.16
_ROUNDS = 5
# The smallest person expected is this share of the low quantile of the samples.
_MIN_HEIGHT_SHARE, _LOW_QUANTILE = 0.8, 0.05
_SLOPES = np.linspace(-2.0, 2.0, 17)
_SAMPLES_PER_SLOPE = 40
# Standard deviation of a calibrated model at the horizon, in image heights: heights are not linear if the
# camera looks down steeply, and homographies are not exact.
_HORIZON_ERROR = 0.02
# Largest standard deviation of a reliable model, in heights.
_RELIABLE = 0.06
# Standard deviation of a calibrated slope, as a share of the slope.
_SLOPE_ERROR = 0.06


@dataclass(frozen=True, slots=True)
class HeightPrior:
    """Prior knowledge of the height model.

    The slope is `N(slope, slope_std^2)`; at the horizon, if known, the height is `N(0, horizon_std^2)`.
    """

    slope: float
    slope_std: float
    horizon: float | None = None
    horizon_std: float = 0.0
    model: HeightModel | None = None
    """The model used until samples determine one."""


def height_prior(
    settings: HeightModelSettings, floor: FloorGeometry | None = None, rows: float = 0.0
) -> HeightPrior:
    """Return the prior of the height model in an image of `rows` rows."""
    if floor is None:
        return HeightPrior(settings.prior_slope, settings.prior_slope_std)
    horizon_std = _HORIZON_ERROR * rows
    if floor.slope is None:
        return HeightPrior(settings.prior_slope, settings.prior_slope_std, floor.horizon, horizon_std)
    slope_std = _SLOPE_ERROR * floor.slope
    model = HeightModel(floor.slope, -floor.slope * floor.horizon, floor.horizon, horizon_std, slope_std)
    return HeightPrior(floor.slope, slope_std, floor.horizon, horizon_std, model)


def fit_height_model(
    samples: Floats, settings: HeightModelSettings, prior: HeightPrior | None = None, distinct_people: int = 1
) -> HeightModel | None:
    """Fit the model to samples `(N, 2)` of foot row and height; return the prior's model if no line fits.

    The samples are of at least `distinct_people` different people, whose common deviation from the average
    stature is estimated too: the fewer people, the larger the uncertainty of the line.

    The fit maximizes the posterior under Tukey's biweight: first over a grid of slopes, which is robust to
    almost half of the samples being outliers, then by a few rounds of reweighted least squares.
    """
    prior = prior or height_prior(settings)
    foot_rows, height = samples.T
    slope, offset = _best_of_grid(foot_rows, height, prior)
    precision = np.diag([1e-9, prior.slope_std**-2, distinct_people / _STATURE**2])
    center, stature = float(foot_rows.mean()), 0.0
    for _ in range(_ROUNDS):
        expected = slope * foot_rows + offset
        deviation = (height - (1.0 + stature) * expected) / height
        weight = np.maximum(1.0 - (deviation / _OUTLIER) ** 2, 0.0) ** 2
        if not weight.any():
            return prior.model
        center = float(np.average(foot_rows, weights=weight))
        weight = weight / (_CORRELATED_SAMPLES * (_NOISE * height) ** 2)
        terms = np.stack([np.ones_like(foot_rows), foot_rows - center, expected])
        information = (terms * weight) @ terms.T + precision
        moment = (terms * weight) @ height + precision @ [0.0, prior.slope, 0.0]
        if prior.horizon is not None:
            horizon_terms = np.array([1.0, prior.horizon - center, 0.0])
            information += np.outer(horizon_terms, horizon_terms) / prior.horizon_std**2
        level, slope, stature = (float(value) for value in np.linalg.solve(information, moment))
        offset = level - slope * center
    fitted = (1.0 + stature) * (slope * foot_rows + offset)
    scatter = _median(np.abs(height - fitted) / height, _sample_weights(height))
    # In an upright image people are taller towards the bottom; anything else is a misfit.
    if slope <= 0.0 or scatter > settings.max_scatter:
        return prior.model
    (level_variance, covariance), (_, slope_variance) = np.linalg.inv(information)[:2, :2]
    smallest = _MIN_HEIGHT_SHARE * float(np.quantile(height[weight > 0.0], _LOW_QUANTILE))
    # Move the center to where level and slope are uncorrelated.
    level_std = float(np.sqrt(max(level_variance - covariance**2 / slope_variance, 0.0)))
    return HeightModel(
        slope,
        offset,
        center - float(covariance / slope_variance),
        level_std,
        float(np.sqrt(slope_variance)),
        smallest,
    )


def _sample_weights(height: Floats) -> Floats:
    """Return the weight of each sample, 1 on average: more for tall ones, since fragments are short."""
    return np.asarray(height / height.mean())


def _median(values: Floats, weights: Floats) -> float:
    """Return the weighted median."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2.0)])


def _best_of_grid(foot_rows: Floats, height: Floats, prior: HeightPrior) -> tuple[float, float]:
    """Return slope and offset of the grid's best line through a sample or the horizon."""
    slopes = prior.slope + prior.slope_std * _SLOPES
    through = np.linspace(0, len(foot_rows) - 1, min(len(foot_rows), _SAMPLES_PER_SLOPE)).astype(np.int64)
    offsets = height[through] - slopes[:, None] * foot_rows[through]
    if prior.horizon is not None:
        offsets = np.concatenate([offsets, -slopes[:, None] * prior.horizon], axis=1)
    deviation = (height - slopes[:, None, None] * foot_rows - offsets[..., None]) / height
    loss = (
        np.minimum((deviation / _OUTLIER) ** 2, 1.0)
        @ _sample_weights(height)
        * (_OUTLIER / _NOISE) ** 2
        / _CORRELATED_SAMPLES
    )
    loss += (_SLOPES**2)[:, None]
    if prior.horizon is not None:
        loss += ((offsets + slopes[:, None] * prior.horizon) / prior.horizon_std) ** 2
    row, column = divmod(int(np.argmin(loss)), offsets.shape[1])
    return float(slopes[row]), float(offsets[row, column])
