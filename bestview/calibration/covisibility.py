"""Covisibility: which people two cameras could both see, and about what share of them they agree."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.calibration.pinhole import Pinhole
from bestview.calibration.samples import Indices, WalkSamples

_EDGE = 0.04
"""Share of the picture at each edge where somebody may be cut off."""
_SMALL = 0.06
"""Share of the picture's height below which detection is unreliable."""


def covisible_agreement(
    cameras: Sequence[Pinhole], samples: Sequence[WalkSamples], chosen: Sequence[Indices]
) -> float:
    """Return the share of what both cameras could see about which they agree, 0 to 1.

    Args:
        cameras: the two cameras.
        samples: of each of them.
        chosen: the samples that were matched with the other's, (M,) of each.
    """
    agreements = []
    for own, index in ((0, chosen[0]), (1, chosen[1])):
        other = 1 - own
        covisible = fully_in_view(cameras[own], samples[own], cameras[other])
        if len(samples[other].times):
            covisible &= samples[own].times >= samples[other].times.min()
            covisible &= samples[own].times <= samples[other].times.max()
        agreed = np.zeros(len(covisible), dtype=bool)
        agreed[index] = True
        weight = samples[own].weight
        agreements.append(weight[agreed].sum() / max(weight[covisible | agreed].sum(), 1e-9))
    return float(np.sqrt(agreements[0] * agreements[1]))


def fully_in_view(camera: Pinhole, samples: WalkSamples, other: Pinhole) -> NDArray[np.bool_]:
    """Return which of a camera's samples the other camera has completely in view, and large enough, (S,)."""
    feet = other.picture(camera.floor(samples.feet))
    heights = other.heights(feet)
    width, height = other.size
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (np.abs(feet[:, 0] - width / 2) < width * (0.5 - _EDGE))
            & (feet[:, 1] < height * (1 - _EDGE))
            & (feet[:, 1] - heights > height * _EDGE)
            & (heights > height * _SMALL)
        )
