"""View monitor: what is wrong with a camera's picture, and where it lies since a knock or a turn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from server.camera.picture_reports import noticeable_motion
from server.camera.sources.base import Image
from server.camera.substream.picture_scale import PictureScale
from server.messaging.camera_status import PictureMotion
from tracking.boxes import BOX_SIDES
from tracking.detectors import BackgroundDetector, Detector, FusedDetector
from tracking.detectors.background.views.view_matching import TURNED, shift_of_middle
from tracking.detectors.base import Mask
from tracking.frame_rate import frames_in
from tracking.picture_condition import PictureMonitor, cell_rectangles, cells_of
from tracking.types import PictureCondition

_SEEK_S = 3.0
"""Seconds in which a view whose background is learned anew is located if it can be."""


class ViewMonitor:
    """Watches a camera's pictures.

    Args:
        fps: frames per second.
        detector: whose background says how the picture has moved, if it has one.
        scale: of the tracked pictures.
    """

    def __init__(self, fps: float, detector: Detector, scale: PictureScale) -> None:
        self.monitor = PictureMonitor(fps)
        """Says what is wrong with the pictures."""
        self._detector, self._scale = detector, scale
        self._seek = frames_in(_SEEK_S, fps)
        self._noticed = np.eye(3)
        """How the picture had moved when that was noticed last."""
        self._pulse = 0
        self._lost_at: int | None = None
        """The pulse from which on it is unknown where the picture lies; None: it is known."""
        self._covered: NDArray[np.bool_] | None = None
        self._flicker: Mask | None = None
        self._is_blind = False
        self.hidden: NDArray[np.float64] = np.empty((0, BOX_SIDES))
        """The part of the site's picture in which a cover on the lens, or leaves, hide people.

        Rectangles (K, 4) beside each other.
        """
        self.motion: PictureMotion | None = None
        """How the site's picture has moved since the start, as far as known; None: not noticeably."""

    def observe(self, image: Image, pulse: int) -> None:
        """Watch the tracked picture of a pulse after it was searched."""
        was_lost, self._pulse = self._lost_at is not None, pulse
        moved = self._moved()
        if moved is None:
            self._lost_at = pulse if self._lost_at is None else self._lost_at
        else:
            self._lost_at = None
            came_back = was_lost and self.monitor.shows_another_scene
            if came_back or shift_of_middle(moved, image, self._noticed) > TURNED:
                self._noticed = moved
                self.monitor.accept_scene()
        self.monitor.observe(image, pulse)
        self._find_hidden((image.shape[1], image.shape[0]))

    def _find_hidden(self, size: tuple[int, int]) -> None:
        """Find what is hidden in pictures of a size (w, h); the detector ignores what is covered."""
        detector, covered = self._detector, self.monitor.covered
        flicker = None
        if isinstance(detector, BackgroundDetector | FusedDetector):
            flicker = detector.flicker
            if covered is not self._covered:
                none = np.empty((0, BOX_SIDES))
                detector.cover(none if covered is None else cell_rectangles(covered, size))
        # A lens that is partly covered may then go wholly dark: what was the covered part says nothing then.
        is_blind = self.condition == "covered" and not self.monitor.shows_now
        if covered is self._covered and flicker is self._flicker and is_blind is self._is_blind:
            return
        self._covered, self._flicker, self._is_blind = covered, flicker, is_blind
        if is_blind:
            self.hidden = self._scale.boxes_to_site(np.array([[0.0, 0.0, *size]]))
            return
        cells = [] if covered is None else [covered]
        grid = None if covered is None else covered.shape
        cells += [] if flicker is None else [cells_of(flicker, grid)]
        hidden = [] if not cells else [cell_rectangles(np.logical_or.reduce(cells), size)]
        self.hidden = self._scale.boxes_to_site(np.concatenate([np.empty((0, BOX_SIDES)), *hidden]))

    @property
    def condition(self) -> PictureCondition:
        """What is wrong with the picture."""
        return self.monitor.condition

    @property
    def covered_share(self) -> float:
        """The share of the picture that something on the lens hides, once that has lasted, 0 to 1."""
        return 1.0 if self._is_blind else self.monitor.covered_share

    @property
    def since(self) -> int:
        """The frame in which that began."""
        return self.monitor.since

    @property
    def is_located(self) -> bool:
        """Whether the picture is of now, and lies where the homography, moved by `motion`, says.

        A view that could not be located for a while is the one before in another light, unless the camera
        seems to be turned away.
        """
        if not self.monitor.shows_now or self.monitor.shows_another_scene:
            return False
        return self._lost_at is None or self._pulse - self._lost_at >= self._seek

    def _moved(self) -> NDArray[np.float64] | None:
        """Return how the tracked picture has moved, (3, 3), and update `motion`.

        None: it shows a view that could not be located; the motion stays that of the view before.
        """
        detector = self._detector
        if not isinstance(detector, BackgroundDetector | FusedDetector):
            return np.eye(3)
        moved = detector.camera_motion
        if moved is None:
            return None
        try:
            self.motion = noticeable_motion(self._scale.motion_to_site(moved), self._scale.site)
        except ValueError:  # so far that nothing of the first view is in front of the camera
            return None
        return moved
