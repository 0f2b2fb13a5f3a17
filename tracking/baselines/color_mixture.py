"""Mixtures of Gaussians over colours, and how probable each colour is somebody's (Todor 2009, chapter 9).

Colours are told apart in steps of eight: whatever is asked of a pixel's colour is worked out once for each
step, and looked up from then on.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from tracking.boxes import Floats
from tracking.detectors.base import Image, Plane

_STEP = 8
_LEVELS = 256 // _STEP
COLOURS = _LEVELS**3
_LEAST = _STEP**2 / 2
"""Added to the variance of every channel: no colour is surer than a step is wide."""
_MOST_PIXELS = 1000
"""That a mixture is fitted to, spread evenly over those that there are."""
_ROUNDS = 20
_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, _ROUNDS, 1e-2)

_axis = np.arange(_LEVELS) * float(_STEP) + (_STEP - 1) / 2
MIDDLES: Floats = np.stack(np.meshgrid(_axis, _axis, _axis, indexing="ij"), axis=-1).reshape(COLOURS, 3)
"""The colour in the middle of each step."""


@dataclass(frozen=True, slots=True, eq=False)
class Mixture:
    """Σ p_k N(μ_k, Σ_k) over the three channels of a colour, 0..255.

    Attributes:
        shares: `(K,)`, p_k, which sum to 1.
        means: `(K, 3)`.
        covariances: `(K, 3, 3)`.
    """

    shares: Floats
    means: Floats
    covariances: Floats

    def densities(self, colours: Floats) -> Floats:
        """Give p(I) of colours `(..., 3)`."""
        parts = [
            share * multivariate_normal.pdf(colours, mean, covariance)
            for share, mean, covariance in zip(self.shares, self.means, self.covariances, strict=True)
        ]
        return np.asarray(np.sum(parts, axis=0))


def fitted(pixels: Image, parts: int) -> Mixture:
    """Fit a mixture to pixels `(N, 3)` by expectation and maximisation; N is at least 1.

    It begins with groups along the axis on which they differ most, not by chance: the same pixels give the
    same mixture.
    """
    spread = np.linspace(0, len(pixels) - 1, min(len(pixels), _MOST_PIXELS)).astype(np.int64)
    colours = pixels[spread].astype(np.float64)
    everywhere = np.cov(colours.T, bias=True) + _LEAST * np.eye(3)
    if len(colours) < 2 * parts:
        return Mixture(np.ones(1), colours.mean(axis=0)[None], everywhere[None])
    along = colours @ np.linalg.eigh(everywhere).eigenvectors[:, -1]
    order = np.argsort(np.argsort(along, kind="stable"))
    belongs = np.eye(parts)[order * parts // len(colours)]
    model = cv2.ml.EM.create()
    model.setClustersNumber(parts)
    model.setCovarianceMatrixType(cv2.ml.EM_COV_MAT_GENERIC)
    model.setTermCriteria(_STOP)
    model.trainM(colours, belongs)
    covariances = np.stack([np.asarray(it, dtype=np.float64) for it in model.getCovs()])
    shares = np.asarray(model.getWeights(), dtype=np.float64).ravel()
    return Mixture(shares, np.asarray(model.getMeans(), np.float64), covariances + _LEAST * np.eye(3))


def codes(image: Image) -> NDArray[np.int32]:
    """Give the step of each pixel's colour, `(H, W)`, of a picture `(H, W, 3)`."""
    steps = (image // _STEP).astype(np.int32)
    return np.asarray((steps[..., 0] * _LEVELS + steps[..., 1]) * _LEVELS + steps[..., 2])


def posterior(mine: Floats, others: Floats, prior: float) -> Plane:
    """Give p(O|I) from p(I|O) and p(I|B), each of all colours `(COLOURS,)`, by Bayes' rule."""
    joint = prior * mine
    return np.asarray(joint / np.maximum(joint + (1.0 - prior) * others, 1e-300), dtype=np.float32)
