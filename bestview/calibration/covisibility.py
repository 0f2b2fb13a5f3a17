"""Whom two cameras could both see, and what share of that they agree about."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.calibration.pinhole import Pinhole
from bestview.calibration.samples import Indices, WalkSamples

_EDGE = 0.04
"""Share of the picture at each edge where somebody may be cut off."""
_SMALL = 0.06
"""Share of the picture's height below which nobody is found for sure."""


def covisible_agreement(
    cameras: Sequence[Pinhole], samples: Sequence[WalkSamples], chosen: Sequence[Indices]
) -> float:
    """Give the share of what both cameras could see that they agree about, 0 to 1.

    Args:
        cameras: the two cameras.
        samples: what each of them saw.
        chosen: the samples that were matched with the other's, (M,) of each.
    """
    shares = []
    for own, index in ((0, chosen[0]), (1, chosen[1])):
        other = 1 - own
        within = fully_in_view(cameras[own], samples[own], cameras[other])
        if len(samples[other].times):
            within &= samples[own].times >= samples[other].times.min()
            within &= samples[own].times <= samples[other].times.max()
        agreed = np.zeros(len(within), dtype=bool)
        agreed[index] = True
        weight = samples[own].weight
        shares.append(weight[agreed].sum() / max(weight[within | agreed].sum(), 1e-9))
    return float(np.sqrt(shares[0] * shares[1]))


def fully_in_view(camera: Pinhole, samples: WalkSamples, other: Pinhole) -> NDArray[np.bool_]:
    """Tell which of a camera's samples the other camera has wholly in its picture, and large enough, (S,)."""
    feet = other.picture(camera.floor(samples.feet))
    tall = other.heights(feet)
    width, height = other.size
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (np.abs(feet[:, 0] - width / 2) < width * (0.5 - _EDGE))
            & (feet[:, 1] < height * (1 - _EDGE))
            & (feet[:, 1] - tall > height * _EDGE)
            & (tall > height * _SMALL)
        )
