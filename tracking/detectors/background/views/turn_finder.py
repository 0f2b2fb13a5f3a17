"""Notices that a camera was turned, where the picture no longer fits its background."""

from __future__ import annotations

from tracking.detectors.background.views.view_matching import TURNED, ViewMatch, find_view, shift_of_middle
from tracking.detectors.base import Image

# Share of the background's edges that are where they were, from which the camera is not turned.
_AGREEMENT = 0.7
# Seconds until the first search, and between the two that must agree; each one without a result waits longer,
# up to the longest time.
_FIRST_S, _AGAIN_S, _LONGEST_S = 0.6, 0.4, 5.0
# Largest motion of the picture's middle, as a share of its width, of a camera that has come to rest.
_RESTS = 0.01


class TurnFinder:
    """Looks for the background in pictures of one camera while they do not agree with it."""

    def __init__(self, fps: float) -> None:
        self._frame_s = 1.0 / fps
        self._wait_s = self._left_s = _FIRST_S
        self._found: ViewMatch | None = None

    def find(self, agreement: float, background: Image, image: Image) -> ViewMatch | None:
        """Return where the background lies in the next frame of a camera that was turned, and rests; or None.

        `agreement`: share of the background's edges that the last frames have shown.
        """
        if agreement >= _AGREEMENT:
            self._wait_s = self._left_s = _FIRST_S
            self._found = None
            return None
        self._left_s -= self._frame_s
        if self._left_s > 0.0:
            return None
        before, self._found = self._found, None
        found = find_view(background, image)
        if found is None or shift_of_middle(found.homography, image) < TURNED:
            self._wait_s = min(2.0 * self._wait_s, _LONGEST_S)
            self._left_s = self._wait_s
        elif before is not None and shift_of_middle(found.homography, image, before.homography) <= _RESTS:
            self._wait_s = self._left_s = _FIRST_S
            return found
        else:
            self._found, self._left_s = found, _AGAIN_S
        return None
