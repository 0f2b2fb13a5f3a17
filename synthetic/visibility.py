"""What a camera sees of figures that hide each other: measured on the figures as they are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, Perspective
from synthetic.drawing.figure import Figure, clip

_COVERED = 128  # alpha from which a pixel belongs to a figure
_SMALLEST = 4.0  # pixels


@dataclass(frozen=True, slots=True)
class Piece:
    """One figure of a picture; a number is whose it is, none is of what only hides."""

    number: int | None
    figure: Figure
    curtain: NDArray[np.uint8] | None  # (h, w) of its part within the picture: share that shows; None: all


@dataclass(frozen=True, slots=True)
class Seen:
    """What shows of one figure."""

    box: Floats  # (4,) pixels: the whole figure, hidden or not, cut at the edge
    share: float  # of the whole figure that shows: not hidden, not beyond the edge

    @property
    def large(self) -> bool:
        """Whether there is enough of it in the picture to speak of."""
        return bool((self.box[2:] - self.box[:2] >= _SMALLEST).all())


def survey(view: Perspective, pieces: Sequence[Piece]) -> dict[int, Seen]:
    """Measure figures that come furthest first; those beyond the picture's edge are left out."""
    owner = np.full((view.height, view.width), -1, dtype=np.int16)
    whole: dict[int, int] = {}
    boxes: dict[int, Floats] = {}
    for piece in pieces:
        covered = piece.figure.patch[:, :, 3] >= _COVERED
        part = clip(piece.figure, view)
        if part is None:
            continue
        shown = covered[part.patch]
        if piece.number is not None:
            whole[piece.number] = max(int(np.count_nonzero(covered)), 1)
            boxes[piece.number] = _box(shown, part.area)
        if piece.curtain is not None:
            shown = shown & (piece.curtain >= _COVERED)
        owner[part.area][shown] = -1 if piece.number is None else piece.number
    counts = np.bincount(owner[owner >= 0], minlength=max(whole, default=0) + 1)
    return {number: Seen(boxes[number], float(counts[number]) / area) for number, area in whole.items()}


def _box(shown: NDArray[np.bool_], area: tuple[slice, slice]) -> Floats:
    x, y, width, height = cv2.boundingRect(shown.astype(np.uint8))
    left, top = area[1].start + x, area[0].start + y
    return np.array([left, top, left + width, top + height], dtype=np.float64)
