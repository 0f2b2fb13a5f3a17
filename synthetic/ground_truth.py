"""Ground truth of a frame: boxes and visible shares, measured on the drawn figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.camera_view import CameraView, DrawnPerson
from synthetic.cameras.pinhole import Floats, PinholeCamera
from synthetic.drawing.figure import Figure, clip_to_image

_GLIMPSE = 0.1  # least visible share of a person in a corridor in the ground truth
_COVERED = 128  # alpha from which a pixel belongs to a figure
_SMALLEST = 4.0  # pixels


@dataclass(frozen=True, slots=True)
class CameraTruth:
    """The objects in one camera's image: parallel arrays in the order of the ids."""

    ids: NDArray[np.int64]  # (N,) from 1; one person has one id in every camera
    boxes: Floats  # (N, 4) left, top, right, bottom in pixels: the whole figure, clipped to the image
    visibility: Floats  # (N,) share of the whole figure that is neither hidden nor beyond the edge; 0..1
    distances: Floats  # (N,) meters from the camera


def measure_truth(camera_view: CameraView, people: Sequence[DrawnPerson]) -> CameraTruth:
    """Measure the ground truth of drawn people, given farthest first."""
    found = measure_visibility(
        camera_view.view,
        [FigureLayer(person.walker, person.figure, person.visible_mask) for person in people],
    )
    kept = [
        person
        for person in sorted(people, key=lambda person: person.walker)
        if (person.inside or found[person.walker].share >= _GLIMPSE) and found[person.walker].measurable
    ]
    return CameraTruth(
        np.array([person.walker + 1 for person in kept], dtype=np.int64),
        np.array([found[person.walker].box for person in kept], dtype=np.float64).reshape(-1, 4),
        np.array([found[person.walker].share for person in kept], dtype=np.float64),
        np.array([np.linalg.norm(person.joints.mean(axis=0) - camera_view.view.center) for person in kept]),
    )


@dataclass(frozen=True, slots=True)
class FigureLayer:
    """One figure of an image: of an object, by its number, or of an occluder (None)."""

    number: int | None
    figure: Figure
    visible_mask: NDArray[np.uint8] | None  # (h, w) of its part within the image; None: fully visible


@dataclass(frozen=True, slots=True)
class FigureVisibility:
    """The box and the visible share of one figure."""

    box: Floats  # (4,) pixels: the whole figure, clipped to the image
    share: float  # of the whole figure that is neither hidden nor beyond the edge

    @property
    def measurable(self) -> bool:
        """Whether enough of it is in the image for ground truth."""
        return bool((self.box[2:] - self.box[:2] >= _SMALLEST).all())


def measure_visibility(view: PinholeCamera, layers: Sequence[FigureLayer]) -> dict[int, FigureVisibility]:
    """Measure figures, given farthest first; those outside the image are left out."""
    owner = np.full((view.height, view.width), -1, dtype=np.int16)
    total_areas: dict[int, int] = {}
    boxes: dict[int, Floats] = {}
    for layer in layers:
        covered = layer.figure.patch[:, :, 3] >= _COVERED
        part = clip_to_image(layer.figure, view)
        if part is None:
            continue
        visible = covered[part.patch]
        if layer.number is not None:
            total_areas[layer.number] = max(int(np.count_nonzero(covered)), 1)
            boxes[layer.number] = _box(visible, part.area)
        if layer.visible_mask is not None:
            visible = visible & (layer.visible_mask >= _COVERED)
        owner[part.area][visible] = -1 if layer.number is None else layer.number
    counts = np.bincount(owner[owner >= 0], minlength=max(total_areas, default=0) + 1)
    return {
        number: FigureVisibility(boxes[number], float(counts[number]) / area)
        for number, area in total_areas.items()
    }


def _box(visible: NDArray[np.bool_], area: tuple[slice, slice]) -> Floats:
    x, y, width, height = cv2.boundingRect(visible.astype(np.uint8))
    left, top = area[1].start + x, area[0].start + y
    return np.array([left, top, left + width, top + height], dtype=np.float64)
