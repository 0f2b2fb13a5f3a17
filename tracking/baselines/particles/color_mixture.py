"""Gaussian mixtures over colors, and posterior color probabilities (Todor 2009, chapter 9).

Colors are quantized in steps of eight: a function of the color is computed once per step and then looked up.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.detectors.base import Image, Plane

_STEP = 8
_LEVELS = 256 // _STEP
COLOR_CODES = _LEVELS**3
_MIN_VARIANCE = _STEP**2 / 2
"""Added to the variance of every channel, because of the quantization."""
_MAX_PIXELS = 1000
"""Pixels that a mixture is fitted to, spread evenly over all."""
_MAX_ITERATIONS = 20
_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, _MAX_ITERATIONS, 1e-2)

_axis = np.arange(_LEVELS) * float(_STEP) + (_STEP - 1) / 2
CODE_COLORS: Floats = np.stack(np.meshgrid(_axis, _axis, _axis, indexing="ij"), axis=-1).reshape(
    COLOR_CODES, 3
)
"""The color in the middle of each quantization step."""


@dataclass(frozen=True, slots=True, eq=False)
class GaussianMixture:
    """Σ p_k N(μ_k, Σ_k) over the three channels of a color, 0..255.

    Attributes:
        weights: `(K,)`, p_k, which sum to 1.
        means: `(K, 3)`.
        covariances: `(K, 3, 3)`.
    """

    weights: Floats
    means: Floats
    covariances: Floats

    def densities(self, colors: Floats) -> Floats:
        """Return the densities p(I) of colors `(..., 3)`."""
        components = [
            weight * _normal_density(colors - mean, covariance)
            for weight, mean, covariance in zip(self.weights, self.means, self.covariances, strict=True)
        ]
        return np.asarray(np.sum(components, axis=0))


def _normal_density(deviations: Floats, covariance: Floats) -> Floats:
    """Return the density of a normal distribution at deviations `(..., 3)` from its mean.

    `scipy.stats` gives the same to the last digit, but takes half a second to load.
    """
    variances, axes = scipy.linalg.eigh(covariance)
    distances = np.square(deviations @ (axes * np.sqrt(1 / variances))).sum(axis=-1)
    constant = len(variances) * np.log(2 * np.pi) + np.log(variances).sum()
    return np.asarray(np.exp(-0.5 * (constant + distances)))


def fit_mixture(pixels: Image, components: int) -> GaussianMixture:
    """Fit a mixture to pixels `(N, 3)`, N at least 1, by expectation maximization.

    The initial groups are quantiles along the principal axis, so that the result is deterministic.
    """
    sampled = np.linspace(0, len(pixels) - 1, min(len(pixels), _MAX_PIXELS)).astype(np.int64)
    colors = pixels[sampled].astype(np.float64)
    covariance = np.cov(colors.T, bias=True) + _MIN_VARIANCE * np.eye(3)
    if len(colors) < 2 * components:
        return GaussianMixture(np.ones(1), colors.mean(axis=0)[None], covariance[None])
    projections = colors @ np.linalg.eigh(covariance).eigenvectors[:, -1]
    order = np.argsort(np.argsort(projections, kind="stable"))
    memberships = np.eye(components)[order * components // len(colors)]
    model = cv2.ml.EM.create()
    model.setClustersNumber(components)
    model.setCovarianceMatrixType(cv2.ml.EM_COV_MAT_GENERIC)
    model.setTermCriteria(_STOP)
    model.trainM(colors, memberships)
    covariances = np.stack([np.asarray(matrix, dtype=np.float64) for matrix in model.getCovs()])
    weights = np.asarray(model.getWeights(), dtype=np.float64).ravel()
    return GaussianMixture(
        weights, np.asarray(model.getMeans(), np.float64), covariances + _MIN_VARIANCE * np.eye(3)
    )


def color_codes(image: Image) -> NDArray[np.int32]:
    """Return the color code of each pixel, `(H, W)`, of an image `(H, W, 3)`."""
    steps = (image // _STEP).astype(np.int32)
    return np.asarray((steps[..., 0] * _LEVELS + steps[..., 1]) * _LEVELS + steps[..., 2])


def posterior(object_likelihood: Floats, background_likelihood: Floats, prior: float) -> Plane:
    """Compute p(O|I) by Bayes' rule from p(I|O) and p(I|B), each over all color codes."""
    joint = prior * object_likelihood
    return np.asarray(
        joint / np.maximum(joint + (1.0 - prior) * background_likelihood, 1e-300), dtype=np.float32
    )
