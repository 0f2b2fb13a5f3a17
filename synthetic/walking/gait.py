"""How far somebody has come, so that a gait goes on from one planned stretch of a way to the next."""

from __future__ import annotations

import numpy as np

from synthetic.cameras.pinhole import Floats


def whole(steps: Floats, stride: float) -> Floats:
    """Add steps ``(S,)`` up, stretched to whole strides: so one round's gait ends where the next begins."""
    walked = np.cumsum(steps) - steps[0]
    strides = float(walked[-1]) / stride
    if strides < 0.25:  # noqa: PLR2004 — hardly a step
        return np.zeros_like(walked)
    stretched: Floats = walked * (max(round(strides), 1) / strides)
    return stretched
