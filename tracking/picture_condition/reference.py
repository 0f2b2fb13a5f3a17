"""What a camera showed when all was well, and what is wrong with a picture relative to it.

In the cells that have edges in the reference, the scene is *seen* if the gradients agree, whatever the light.
A cell in which it is not is *plain* if it has hardly any edges, and *other* if what it shows instead stands
still; the rest moves: people, a bus.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.background.motion import STILL, Motion
from tracking.detectors.background.registration import Registration
from tracking.detectors.background.views.view_matching import TURNED
from tracking.detectors.base import Image, Plane
from tracking.picture_condition.structure import Structure, cell_means, reduce, structure_of
from tracking.types import PictureCondition

CONDITIONS: tuple[PictureCondition, ...] = get_args(PictureCondition)

# Squared gradient, gray levels per pixel, from which a cell has edges; and the least share of such cells
# without which nothing is said.
_EDGE, _LEAST_TEXTURED = 1.0, 0.1
# Correlation of gradients from which a cell shows the reference, and from which it stands still.
_SEEN, _STANDS = 0.4, 0.7
# Squared gradient, as a share of the reference's, below which a cell that is not seen is plain.
_PLAIN = 0.3
# Shares of the cells: seen ones with which the scene is there, without which it is not, and with which it is
# found elsewhere; plain or other ones from which the lens is covered, plain ones from which nothing is left.
_SCENE, _NO_SCENE, _FOUND = 0.5, 0.25, 0.35
_COVERED, _COVERED_WHOLLY = 0.4, 0.75
# Share of fine detail that is left, relative to that of the gradients, below which the picture is blurred.
_BLURRED, _LEAST_DETAIL = 0.3, 1e-6
# Squared gradient over that of the noise below which the picture is noisy: edges less than twice the noise.
_NOISY = 4.0
# Seconds between searches.
_SEARCH_EVERY_S = 1.0


@dataclass(frozen=True, slots=True)
class _Shares:
    """Shares of the cells with edges: where the scene is seen, and where it is not and nothing moves."""

    seen: float
    plain: float
    other: float

    def hidden(self) -> PictureCondition | None:
        """Return what hides the scene; None: nothing does."""
        if self.plain + self.other < _COVERED:
            return None
        if self.seen < _NO_SCENE and self.other > self.plain / 2.0:
            return "turned"
        return "covered" if self.plain >= self.other else None


class Reference:
    """The mean of what a camera showed.

    Args:
        structure: of the first picture.
    """

    def __init__(self, structure: Structure) -> None:
        self._gray: Plane = structure.gray.copy()
        self._structure = structure
        # Means of squares, both: the mean picture has weaker gradients than each of those that differ.
        self._detail, self._gradient = structure.detail, structure.edges
        self._motion, self._search_at = STILL, 0.0

    @property
    def structure(self) -> Structure:
        """What the camera showed."""
        return self._structure

    def learn(
        self, structure: Structure, share: float, hidden: npt.NDArray[np.bool_], noise: float = 0.0
    ) -> None:
        """Take over a share, up to 1, of a picture, except where it is hidden.

        Args:
            structure: of the picture.
            share: how much of it.
            hidden: `(h, w)`.
            noise: mean squared gradient that is noise.
        """
        shares = np.where(hidden, np.float32(0.0), np.float32(share))
        self._gray += shares * (structure.gray - self._gray)
        shown = cell_means(shares, structure.edges.shape)
        self._detail = self._detail + shown * (structure.detail - self._detail)
        self._gradient = self._gradient + shown * (np.maximum(structure.edges - noise, 0.0) - self._gradient)
        self._structure = structure_of(self._gray)

    def sign(self, structure: Structure, before: Structure, noise: float, seconds: float) -> PictureCondition:
        """Return what seems to be wrong with a picture.

        Args:
            structure: of the picture.
            before: of the one about a second before.
            noise: mean squared gradient that is noise.
            seconds: the picture's time.
        """
        textured = self._structure.edges > _EDGE
        if np.count_nonzero(textured) < _LEAST_TEXTURED * textured.size:
            return "clear"
        detail = structure.detail
        shares = self._shares(structure, before, noise)
        if shares.seen < _SCENE:
            size = (structure.gray.shape[1], structure.gray.shape[0])
            motion = self._find(structure, seconds)
            if motion != STILL:
                aligned = self._aligned(structure, motion)
                moved = self._shares(aligned, self._aligned(before, motion), noise)
                if moved.seen >= max(_FOUND, shares.seen):
                    if motion.distance(STILL, size) > TURNED * size[0]:
                        return "turned"
                    structure, shares = aligned, moved
        edges = np.maximum(structure.edges - noise, 0.0)
        if shares.plain <= _COVERED_WHOLLY and np.median(edges[textured]) < _NOISY * noise:
            return "noisy"
        if hidden := shares.hidden():
            return hidden
        seen = textured & (structure.agreement(self._structure) >= _SEEN)
        if shares.seen < _NO_SCENE or not seen.any():
            return "clear"
        sharp = np.median(detail[seen] / np.maximum(self._detail[seen], _LEAST_DETAIL))
        contrast = np.median(edges[seen] / np.maximum(self._gradient[seen], _LEAST_DETAIL))
        return "blurred" if sharp < _BLURRED * contrast else "clear"

    def is_seen(self, structure: Structure) -> bool:
        """Return whether a picture shows the scene where it was."""
        textured = self._structure.edges > _EDGE
        return _share(structure.agreement(self._structure) >= _SEEN, textured) >= _SCENE

    def _shares(self, structure: Structure, before: Structure, noise: float) -> _Shares:
        textured = self._structure.edges > _EDGE
        seen = structure.agreement(self._structure) >= _SEEN
        plain = structure.edges - noise < _PLAIN * self._structure.edges
        stands = structure.agreement(before) >= _STANDS
        return _Shares(
            _share(seen, textured), _share(~seen & plain, textured), _share(~seen & ~plain & stands, textured)
        )

    def _find(self, structure: Structure, seconds: float) -> Motion:
        """Return how the scene has moved; `STILL` also if it is not in the picture.

        It is sought now and then; a camera that was knocked or turned does not move all the time.
        """
        if seconds >= self._search_at:
            self._search_at = seconds + _SEARCH_EVERY_S
            registration = Registration()
            registration.set_background(_image_of(self._gray))
            self._motion = registration.search(_image_of(structure.gray)) or STILL
        return self._motion

    def _aligned(self, structure: Structure, motion: Motion) -> Structure:
        return structure_of(reduce(motion.align(_image_of(structure.gray), _image_of(self._gray))))


def _share(cells: npt.NDArray[np.bool_], among: npt.NDArray[np.bool_]) -> float:
    return float(np.count_nonzero(cells & among)) / max(float(np.count_nonzero(among)), 1.0)


def _image_of(gray: Plane) -> Image:
    levels = np.clip(gray + 0.5, 0.0, 255.0).astype(np.uint8)
    return np.asarray(cv2.merge([levels, levels, levels]), dtype=np.uint8)
