"""Body shape of a standing person as five rectangles, for integral images."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Plane


@dataclass(frozen=True, slots=True)
class BodyPart:
    """A rectangle in shares of a person's box: 0 is its left or top, 1 its right or bottom."""

    left: float
    top: float
    right: float
    bottom: float


# Covered by more than half of the isolated people, averaged over several recordings.
PERSON_PARTS = (
    BodyPart(0.36, 0.0, 0.66, 0.1),  # head
    BodyPart(0.30, 0.1, 0.72, 0.2),  # neck and shoulders
    BodyPart(0.20, 0.2, 0.80, 0.5),  # trunk and arms
    BodyPart(0.25, 0.5, 0.75, 0.7),  # hips
    BodyPart(0.26, 0.7, 0.70, 1.0),  # legs
)
BOX_PARTS = (BodyPart(0.0, 0.0, 1.0, 1.0),)

Body = Literal["person", "box"]
BODY_PARTS: dict[Body, tuple[BodyPart, ...]] = {"person": PERSON_PARTS, "box": BOX_PARTS}


def integral_image(plane: Plane) -> npt.NDArray[np.float64]:
    """Return the integral image of a plane, `(H + 1, W + 1)`."""
    return np.asarray(cv2.integral(plane, sdepth=cv2.CV_64F))


def part_rectangles(
    boxes: npt.NDArray[np.float64], parts: tuple[BodyPart, ...], shape: tuple[int, ...]
) -> PartRectangles:
    """Return the body parts of boxes `(K, 4)` in whole cells, clipped to a plane of `shape`."""
    across = (boxes[:, 2] - boxes[:, 0])[:, None]
    down = (boxes[:, 3] - boxes[:, 1])[:, None]
    shares = np.array([(part.left, part.top, part.right, part.bottom) for part in parts])
    columns, rows = (boxes[:, [0]], across, shape[1]), (boxes[:, [1]], down, shape[0])
    left, top, right, bottom = (
        np.clip(np.rint(begin + share * length), 0, size).astype(np.int64)
        for share, (begin, length, size) in zip(shares.T, (columns, rows, columns, rows), strict=True)
    )
    return PartRectangles(left, top, right, bottom)


def body_rectangles(boxes: npt.NDArray[np.float64], body: Body, shape: tuple[int, ...]) -> PartRectangles:
    """Return the parts of bodies of one shape in boxes `(K, 4)`, clipped to a plane of `shape`."""
    return part_rectangles(boxes, BODY_PARTS[body], shape)


@dataclass(frozen=True, slots=True, eq=False)
class PartRectangles:
    """The parts of K bodies in whole cells, each `(K, P)`."""

    left: npt.NDArray[np.int64]
    top: npt.NDArray[np.int64]
    right: npt.NDArray[np.int64]
    bottom: npt.NDArray[np.int64]

    def sums(self, integrals: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Sum a plane, given its integral image, over each body: `(K,)`, or `(K, C)` for `C` planes."""
        upper = integrals[self.top, self.right] - integrals[self.top, self.left]
        lower = integrals[self.bottom, self.right] - integrals[self.bottom, self.left]
        return np.asarray((lower - upper).sum(axis=1))

    @property
    def extent(self) -> tuple[npt.NDArray[np.int64], ...]:
        """Left, top, right and bottom of the whole bodies, each `(K,)`."""
        return self.left.min(axis=1), self.top.min(axis=1), self.right.max(axis=1), self.bottom.max(axis=1)

    def select(self, chosen: npt.NDArray[np.int64]) -> PartRectangles:
        """Return the parts of the chosen bodies."""
        return PartRectangles(self.left[chosen], self.top[chosen], self.right[chosen], self.bottom[chosen])

    def followed_by(self, other: PartRectangles) -> PartRectangles:
        """Return these parts, then those of other bodies of the same shape."""
        return PartRectangles(
            np.concatenate([self.left, other.left]),
            np.concatenate([self.top, other.top]),
            np.concatenate([self.right, other.right]),
            np.concatenate([self.bottom, other.bottom]),
        )

    def clip_to(self, region: tuple[slice, slice]) -> PartRectangles:
        """Return the parts relative to a region of the plane, clipped to it."""
        rows, columns = region
        width, height = columns.stop - columns.start, rows.stop - rows.start
        return PartRectangles(
            np.clip(self.left - columns.start, 0, width),
            np.clip(self.top - rows.start, 0, height),
            np.clip(self.right - columns.start, 0, width),
            np.clip(self.bottom - rows.start, 0, height),
        )

    def bounds(self, k: int) -> tuple[slice, slice]:
        """Return the rows and columns that body `k` spans."""
        rows = slice(int(self.top[k].min()), int(self.bottom[k].max()))
        return rows, slice(int(self.left[k].min()), int(self.right[k].max()))

    def mask(self, k: int) -> npt.NDArray[np.bool_]:
        """Return the mask of body `k` within its `bounds`."""
        rows, columns = self.bounds(k)
        x, y = columns.start, rows.start
        inside = np.zeros((rows.stop - y, columns.stop - x), dtype=np.bool_)
        lefts, tops, rights, bottoms = self.left[k], self.top[k], self.right[k], self.bottom[k]
        for left, top, right, bottom in zip(lefts, tops, rights, bottoms, strict=True):
            inside[top - y : bottom - y, left - x : right - x] = True
        return inside
