"""Ground truth of a frame, measured on the figures as they are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.camera_view import Actor, Stage
from synthetic.cameras.pinhole import Floats
from synthetic.visibility import Piece, survey

_GLIMPSE = 0.1  # of a walker in a corridor that must show for it to be part of the truth


@dataclass(frozen=True, slots=True)
class CameraTruth:
    """Who is in one camera's picture. Rows belong together and are in the order of the ids."""

    ids: NDArray[np.int64]  # (N,) from 1; one person has one id in every camera
    boxes: (
        Floats  # (N, 4) left, top, right, bottom in pixels: the whole figure, hidden or not, cut at the edge
    )
    visible: Floats  # (N,) share of the whole figure that shows: not hidden, not beyond the edge; 0..1
    away: Floats  # (N,) metres from the camera


def judge(stage: Stage, actors: Sequence[Actor]) -> CameraTruth:
    """Measure boxes and visible shares of the actors, which come furthest first."""
    found = survey(stage.view, [Piece(actor.walker, actor.figure, actor.curtain) for actor in actors])
    kept = [
        actor
        for actor in sorted(actors, key=lambda actor: actor.walker)
        if (actor.inside or found[actor.walker].share >= _GLIMPSE) and found[actor.walker].large
    ]
    return CameraTruth(
        np.array([actor.walker + 1 for actor in kept], dtype=np.int64),
        np.array([found[actor.walker].box for actor in kept], dtype=np.float64).reshape(-1, 4),
        np.array([found[actor.walker].share for actor in kept], dtype=np.float64),
        np.array([np.linalg.norm(actor.joints.mean(axis=0) - stage.view.centre) for actor in kept]),
    )
