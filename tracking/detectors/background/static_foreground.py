"""Static foreground (ghosts): holes in the background left by people present while it was learned."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Image, Mask, Plane, require_positive
from tracking.frame_rate import DEFAULT_FPS, frames_in

_RING = np.ones((5, 5), dtype=np.uint8)
_SMALL = np.ones((3, 3), dtype=np.uint8)
# Margin around a region in which its outline lies, pixels.
_OUTLINE_MARGIN = 6
# Window (width, height) around a pixel of the outline in which the colors of its sides are compared.
_CONTRAST_WINDOW = (9, 9)
# Fewest checks that say that something does not move; counts are limited to what a byte holds.
_MIN_CHECKS, _MAX_COUNT = 3, np.uint8(200)


@dataclass(frozen=True, slots=True)
class StaticForegroundSettings:
    """When foreground that never moves is absorbed into the background.

    Raises:
        ValueError: a time is not positive.
    """

    check_every_s: float = 0.2  # seconds between two checks for motion
    still_s: float = 1.2  # seconds without motion before a region is examined
    settled_after_s: float = 4.0  # seconds as background after which a pixel counts as settled
    settled_still_s: float = 10.0  # seconds without motion at settled pixels: moved furniture, not ghosts
    motion_threshold: float = 14.0  # gray levels between two checks that count as motion
    min_outline_share: float = 0.3  # least share of a region's outline that is next to background
    min_edge_ratio: float = 1.3  # contrast of a ghost's outline in the background over that in the frame
    min_sharper_share: float = 0.65  # least share of the outline with that ratio
    min_area: int = 40  # square pixels of the working image; smaller regions are noise

    def __post_init__(self) -> None:
        require_positive(self, "check_every_s", "still_s", "settled_after_s", "settled_still_s")


class GhostFinder:
    """Distinguishes static foreground (ghosts) from people who stand still, by their outline.

    A person's outline is an edge in the frame but not in the background; a ghost's outline is an edge in the
    background but not in the frame. Only the outline towards the background is informative: inside the
    foreground a region may end at another person or at a sleeve. Ghosts exist since the background was
    learned, so at pixels where the background was visible static foreground has to persist longer.
    """

    def __init__(self, settings: StaticForegroundSettings, fps: float = DEFAULT_FPS) -> None:
        self._settings = settings
        self._check_every = frames_in(settings.check_every_s, fps)
        checks_per_s = fps / self._check_every
        self._still_checks = frames_in(settings.still_s, checks_per_s, _MIN_CHECKS)
        self._settled_after = frames_in(settings.settled_after_s, checks_per_s, _MIN_CHECKS)
        self._settled_still_checks = frames_in(settings.settled_still_s, checks_per_s, _MIN_CHECKS)
        self._frames = 0
        self._last: Mask | None = None
        self._still: Mask | None = None
        self._background_checks: Mask = np.zeros((1, 1), dtype=np.uint8)

    def is_due(self) -> bool:
        """Count a frame; return whether it is to be checked."""
        self._frames += 1
        return self._frames % self._check_every == 0

    def find(self, image: Image, background: Image, foreground: Mask) -> Mask | None:
        """Return the mask of static foreground to absorb in this frame, or `None`.

        Args:
            image: `(H, W, 3)`, at the gain of the background.
            background: `(H, W, 3)`.
            foreground: `(H, W)`, 255 where the image differs from the background.
        """
        gray = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        still = self._count_still(gray, foreground)
        self._background_checks = np.minimum(self._background_checks, _MAX_COUNT) + (foreground == 0).astype(
            np.uint8
        )
        settled = self._background_checks >= self._settled_after
        static = np.asarray(still >= np.where(settled, self._settled_still_checks, self._still_checks))
        if not static.any():
            return None
        return self._check_regions(image, background, foreground, static)

    def _count_still(self, gray: Mask, foreground: Mask) -> Mask:
        if self._last is None or self._still is None:
            self._still = np.zeros_like(gray)
        else:
            motionless = (cv2.absdiff(gray, self._last) < self._settings.motion_threshold) & (foreground > 0)
            counted = np.minimum(self._still, _MAX_COUNT) + np.uint8(1)
            self._still = np.where(motionless, counted, np.uint8(0)).astype(np.uint8)
        self._last = gray
        return self._still

    def _check_regions(
        self, image: Image, background: Image, foreground: Mask, static: npt.NDArray[np.bool_]
    ) -> Mask | None:
        """Return the mask of the motionless regions whose outline is that of a ghost."""
        regions = cv2.morphologyEx(static.astype(np.uint8), cv2.MORPH_OPEN, _SMALL)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(regions)
        border = cv2.morphologyEx(foreground, cv2.MORPH_GRADIENT, _RING) > 0
        found = np.zeros_like(foreground)
        for label in range(1, count):
            left, top, width, height, area = (int(value) for value in stats[label])
            if area < self._settings.min_area:
                continue
            rows = slice(max(top - _OUTLINE_MARGIN, 0), top + height + _OUTLINE_MARGIN)
            columns = slice(max(left - _OUTLINE_MARGIN, 0), left + width + _OUTLINE_MARGIN)
            region = (labels[rows, columns] == label).astype(np.uint8)
            grown = cv2.dilate(region, _RING)
            outline = (grown - cv2.erode(region, _RING)) > 0
            exposed = outline & border[rows, columns]
            if np.count_nonzero(exposed) < self._settings.min_outline_share * np.count_nonzero(outline):
                continue
            outside = (foreground[rows, columns] == 0).astype(np.float32)
            frame_contrast = _contrast(image[rows, columns], region, outside)[exposed]
            background_contrast = _contrast(background[rows, columns], region, outside)[exposed]
            sharper = np.count_nonzero(background_contrast > self._settings.min_edge_ratio * frame_contrast)
            if sharper > self._settings.min_sharper_share * frame_contrast.size:
                found[rows, columns][grown > 0] = 255
        return found if found.any() else None


def _contrast(image: Image, inside: Mask, outside: Plane) -> Plane:
    """Return the color contrast between both sides of an outline around each pixel, `(h, w)`."""
    sides = []
    for side in (inside.astype(np.float32), outside):
        weight = cv2.boxFilter(side, -1, _CONTRAST_WINDOW, normalize=False, borderType=cv2.BORDER_CONSTANT)
        colors = cv2.boxFilter(
            image.astype(np.float32) * side[..., None],
            -1,
            _CONTRAST_WINDOW,
            normalize=False,
            borderType=cv2.BORDER_CONSTANT,
        )
        sides.append(colors / np.maximum(weight, 1.0)[..., None])
    return np.asarray(np.abs(sides[0] - sides[1]).max(axis=2), dtype=np.float32)
