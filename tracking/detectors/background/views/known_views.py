"""The views that a camera has shown, and where the present one lies relative to the first."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.detectors.background.registration import Registration
from tracking.detectors.background.views.view_matching import ViewMatch, find_view, shift_of_middle
from tracking.detectors.base import Image

_SAME = 0.75
"""Share of a background's edges that another one of the same view shows; other scenes show half by chance."""
_STAYS = 0.01
"""Motion of the picture's middle, as a share of its width, up to which a view is the same."""


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """A background, and where the first view lies in it; None: it could not be located."""

    background: Image
    place: ViewMatch | None


class KnownViews:
    """Locates views that a camera turns to; the first is the one for which it was calibrated."""

    def __init__(self) -> None:
        self._place: ViewMatch | None = ViewMatch(np.eye(3), 0)
        self._first: Image | None = None
        self._located: _View | None = None
        self._last: _View | None = None

    @property
    def homography(self) -> Floats | None:
        """From pixels of the first view to those of the present one, (3, 3); None: it is not located."""
        return None if self._place is None else self._place.homography

    @property
    def last(self) -> Image | None:
        """The background before the present one; None: there was none."""
        return None if self._last is None else self._last.background

    def last_turned(self) -> Image | None:
        """Return the background before the present one as this view shows it, black where it was not seen.

        None: there was none, or one of the two is not located.
        """
        last, here = self._last, self.homography
        if last is None or last.place is None or here is None:
            return None
        turn, size = here @ np.linalg.inv(last.place.homography), last.background.shape[1::-1]
        return np.asarray(cv2.warpPerspective(last.background, turn, size), dtype=np.uint8)

    def leave(self, background: Image, turn: ViewMatch | None = None) -> None:
        """Record the background of the present view, which is seen no longer.

        `turn`: where it lies in the next view; None: unknown.
        """
        self._last = _View(background, self._place)
        if self._first is None:
            self._first = background
        if self._place is not None:
            self._located = self._last
        before = self.homography
        self._place = None if turn is None or before is None else turn.after(before)

    def go_back(self, background: Image) -> None:
        """Record that the view before the present one is seen again, and `background` no longer."""
        before = self._last
        self.leave(background)
        self._place = None if before is None else before.place

    def stay(self) -> None:
        """Record that the present view is the one before it in another light."""
        self._place = None if self._last is None else self._last.place

    def forget_place(self) -> None:
        """Forget where the present view lies: the camera has turned on."""
        self._place = None

    def locate(self, background: Image) -> None:
        """Find where a background of a view other than the first lies, if more agrees than before."""
        if self._first is None:
            return
        found, located = _find_confirmed(self._first, background), self._located
        if found is None and located is not None and located.place is not None:
            step = _find_confirmed(located.background, background)
            found = None if step is None else step.after(located.place.homography)
        if found is not None and (self._place is None or found.matches > self._place.matches):
            self._place = found


def shows_view(background: Image, image: Image, least: float = _SAME) -> bool:
    """Return whether an image shows a share of a background's edges where they are, at whatever light."""
    registration = Registration()
    registration.set_background(background)
    return registration.share_seen(image) >= least


def _find_confirmed(before: Image, after: Image) -> ViewMatch | None:
    """Return where a background lies in another; that it lies where it was is confirmed by its edges.

    A clock or a name in the picture stays where it is whatever the camera shows.
    """
    found = find_view(before, after)
    if found is None or shift_of_middle(found.homography, before) > _STAYS:
        return found
    return found if shows_view(before, after) else None
