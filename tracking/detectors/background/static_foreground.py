"""Static foreground (ghosts): holes in the background left by people present while it was learned."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Image, Mask, Plane, require_at_least_one

_RING = np.ones((5, 5), dtype=np.uint8)
_SMALL = np.ones((3, 3), dtype=np.uint8)
# Pixels around a part that its outline may lie in.
_REACH = 6
# Pixels (width, height) around a pixel of the outline over which the colors of its sides are compared.
_AROUND = (9, 9)


@dataclass(frozen=True, slots=True)
class StaticForegroundSettings:
    """When foreground that never moves is absorbed into the background.

    Raises:
        ValueError: it is looked at in no steps.
    """

    check_every: int = 5  # frames between two checks of what has not moved
    still_checks: int = 6  # checks in a row without motion before a region is judged
    settled_after_checks: int = 20  # checks that agree with the background after which a pixel is settled
    settled_still_checks: int = 50  # checks without motion needed at settled pixels: furniture, not ghosts
    motion_threshold: float = 14.0  # gray levels between two checks that count as motion
    min_outline_share: float = 0.3  # least share of a region's outline that borders on the background
    min_edge_ratio: float = 1.3  # how much sharper an outline is in the background than in the frame
    min_sharper_share: float = 0.65  # least share of the outline that is sharper in the background
    min_area: int = 40  # square pixels of the working image; smaller regions are noise

    def __post_init__(self) -> None:
        require_at_least_one(self, "check_every")


class StaticForegroundFilter:
    """Distinguishes static foreground (ghosts) from people who stand still, by their outline.

    A person's outline is an edge in the frame and not in the background; a ghost's is one in the
    background and not in the frame. Only the outline towards the background says anything: inside the
    foreground a part ends where somebody walks before it, or where a sleeve does. Ghosts are as old as
    the background, so that where it was seen for a while what stands still has to do so for longer.
    """

    def __init__(self, settings: StaticForegroundSettings) -> None:
        self._settings = settings
        self._frames = 0
        self._last: Mask | None = None
        self._still: Mask | None = None
        self._background_checks: Mask = np.zeros((1, 1), dtype=np.uint8)

    def is_due(self) -> bool:
        """Count a frame; return whether it is one to check."""
        self._frames += 1
        return self._frames % self._settings.check_every == 0

    def find(self, image: Image, background: Image, foreground: Mask) -> Mask | None:
        """Return the mask of static foreground to absorb in this frame, or `None`.

        Args:
            image: `(H, W, 3)`, at the gain of the background.
            background: `(H, W, 3)`.
            foreground: `(H, W)`, 255 where the image differs from the background.
        """
        gray = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        still = self._count_still(gray, foreground)
        self._background_checks = np.minimum(self._background_checks, np.uint8(200)) + (
            foreground == 0
        ).astype(np.uint8)
        sure = self._background_checks >= self._settings.settled_after_checks
        waited = np.asarray(
            still >= np.where(sure, self._settings.settled_still_checks, self._settings.still_checks)
        )
        if not waited.any():
            return None
        return self._check_regions(image, background, foreground, waited)

    def _count_still(self, gray: Mask, foreground: Mask) -> Mask:
        if self._last is None or self._still is None:
            self._still = np.zeros_like(gray)
        else:
            motionless = (cv2.absdiff(gray, self._last) < self._settings.motion_threshold) & (foreground > 0)
            grown = np.minimum(self._still, np.uint8(200)) + np.uint8(1)
            self._still = np.where(motionless, grown, np.uint8(0)).astype(np.uint8)
        self._last = gray
        return self._still

    def _check_regions(
        self, image: Image, background: Image, foreground: Mask, waited: npt.NDArray[np.bool_]
    ) -> Mask | None:
        """Check the motionless regions one by one."""
        parts = cv2.morphologyEx(waited.astype(np.uint8), cv2.MORPH_OPEN, _SMALL)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(parts)
        border = cv2.morphologyEx(foreground, cv2.MORPH_GRADIENT, _RING) > 0
        found = np.zeros_like(foreground)
        for label in range(1, count):
            left, top, width, height, area = (int(value) for value in stats[label])
            if area < self._settings.min_area:
                continue
            rows = slice(max(top - _REACH, 0), top + height + _REACH)
            columns = slice(max(left - _REACH, 0), left + width + _REACH)
            part = (labels[rows, columns] == label).astype(np.uint8)
            grown = cv2.dilate(part, _RING)
            outline = (grown - cv2.erode(part, _RING)) > 0
            free = outline & border[rows, columns]
            if np.count_nonzero(free) < self._settings.min_outline_share * np.count_nonzero(outline):
                continue
            outside = (foreground[rows, columns] == 0).astype(np.float32)
            now = _contrast(image[rows, columns], part, outside)[free]
            then = _contrast(background[rows, columns], part, outside)[free]
            sharper = np.count_nonzero(then > self._settings.min_edge_ratio * now)
            if sharper > self._settings.min_sharper_share * now.size:
                found[rows, columns][grown > 0] = 255
        return found if found.any() else None


def _contrast(image: Image, inside: Mask, outside: Plane) -> Plane:
    """Return the color contrast across an outline around each pixel, `(h, w)`."""
    sides = []
    for side in (inside.astype(np.float32), outside):
        weight = cv2.boxFilter(side, -1, _AROUND, normalize=False, borderType=cv2.BORDER_CONSTANT)
        colors = cv2.boxFilter(
            image.astype(np.float32) * side[..., None],
            -1,
            _AROUND,
            normalize=False,
            borderType=cv2.BORDER_CONSTANT,
        )
        sides.append(colors / np.maximum(weight, 1.0)[..., None])
    return np.asarray(np.abs(sides[0] - sides[1]).max(axis=2), dtype=np.float32)
