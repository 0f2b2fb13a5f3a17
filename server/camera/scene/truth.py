"""Ground truth of a frame, measured on the figures as they are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from server.camera.scene.perspective import Floats
from server.camera.scene.stage import Actor, Stage, clip

_COVERED = 128  # alpha from which a pixel belongs to a figure
_GLIMPSE = 0.1  # of a walker in a corridor that must show for it to be part of the truth
_SMALLEST = 4.0  # pixels


@dataclass(frozen=True, slots=True)
class CameraTruth:
    """Who is in one camera's picture. Rows belong together and are in the order of the ids."""

    ids: NDArray[np.int64]  # (N,) from 1; one person has one id in every camera
    boxes: (
        Floats  # (N, 4) left, top, right, bottom in pixels: the whole figure, hidden or not, cut at the edge
    )
    visible: Floats  # (N,) share of the whole figure that shows: not hidden, not beyond the edge; 0..1


def judge(stage: Stage, actors: Sequence[Actor]) -> CameraTruth:
    """Measure boxes and visible shares of the actors, which come furthest first."""
    view = stage.view
    owner = np.full((view.height, view.width), -1, dtype=np.int16)
    whole: dict[int, int] = {}
    boxes: dict[int, Floats] = {}
    for actor in actors:
        alpha = actor.figure.patch[:, :, 3]
        covered = alpha >= _COVERED
        whole[actor.walker] = max(int(np.count_nonzero(covered)), 1)
        part = clip(actor.figure, view)
        if part is None:
            continue
        shown = covered[part.patch]
        boxes[actor.walker] = _box(shown, part.area)
        if actor.curtain is not None:
            shown = shown & (actor.curtain >= _COVERED)
        owner[part.area][shown] = actor.walker
    counts = np.bincount(owner[owner >= 0], minlength=max(whole, default=0) + 1)
    share = {walker: float(counts[walker]) / area for walker, area in whole.items()}
    kept = [
        actor.walker
        for actor in sorted(actors, key=lambda actor: actor.walker)
        if (actor.inside or share[actor.walker] >= _GLIMPSE) and _large(boxes[actor.walker])
    ]
    return CameraTruth(
        np.array([walker + 1 for walker in kept], dtype=np.int64),
        np.array([boxes[walker] for walker in kept], dtype=np.float64).reshape(-1, 4),
        np.array([share[walker] for walker in kept], dtype=np.float64),
    )


def _box(shown: NDArray[np.bool_], area: tuple[slice, slice]) -> Floats:
    x, y, width, height = cv2.boundingRect(shown.astype(np.uint8))
    left, top = area[1].start + x, area[0].start + y
    return np.array([left, top, left + width, top + height], dtype=np.float64)


def _large(box: Floats) -> bool:
    return bool((box[2:] - box[:2] >= _SMALLEST).all())
