"""Painting a frame: the empty room, shadows, figures furthest first, then the sensor."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.camera_view import Actor, Stage
from synthetic.cameras.pinhole import Perspective
from synthetic.drawing.figure import Figure, clip
from synthetic.drawing.shadow import cast_shadow

Bytes = NDArray[np.uint8]


def compose(stage: Stage, actors: Sequence[Actor]) -> Bytes:
    """Paint a noiseless picture ``(H, W, 3)``, blue, green, red."""
    image = stage.backdrop.image.copy()
    for actor in actors:
        if actor.inside:
            cast_shadow(image, stage.backdrop.floor, stage.view, actor.joints)
    for actor in actors:
        paste(image, stage.view, actor.figure, actor.curtain)
    return image


def paste(image: Bytes, view: Perspective, figure: Figure, curtain: Bytes | None = None) -> None:
    """Lay a figure over a picture ``(H, W, 3)``, in place; a curtain is the share of its part that shows."""
    part = clip(figure, view)
    if part is None:
        return
    patch = figure.patch[part.patch]
    if curtain is not None:
        shown = cv2.multiply(patch, cv2.merge([curtain] * 4), scale=1 / 255)
        patch = np.asarray(shown, dtype=np.uint8)
    through = cv2.cvtColor(255 - patch[:, :, 3], cv2.COLOR_GRAY2BGR)
    behind = cv2.multiply(image[part.area], through, scale=1 / 255)
    image[part.area] = cv2.add(behind, cv2.cvtColor(patch, cv2.COLOR_BGRA2BGR))
