"""The frames from which a background is learned, and their median."""

from __future__ import annotations

import numpy as np

from tracking.detectors.background.light.tone_curve import fit_tone_curves
from tracking.detectors.background.motion import STILL
from tracking.detectors.background.registration import Registration
from tracking.detectors.background.segmentation import largest_difference
from tracking.detectors.base import Image

# Share of the samples that have to show the old background where it is kept, and within how many gray levels.
_SEEN, _SAME = 0.2, 12
# Motion from one frame to the next, and since the first, as shares of the width, from which a camera turns.
# The second is more than that of a mast that sways by a hundredth to each side, across and down.
_TURNS, _TURNS_SLOWLY = 0.01, 0.03


class MedianSamples:
    """Frames of one view, each at the light and the place of the first."""

    def __init__(self) -> None:
        self._images: list[Image] = []
        self._registration = Registration()
        self._last: Image = np.empty((0, 0, 3), dtype=np.uint8)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._images)

    def add(self, image: Image) -> None:
        """Add a frame `(H, W, 3)`."""
        self._last = image
        if not self._images:
            self._registration.set_background(image)
            self._images.append(image)
            return
        first = self._images[0]
        aligned = self._registration.find_still(image).align(image, first)
        self._images.append(fit_tone_curves(aligned, first).invert(aligned, first))

    def have_moved(self, image: Image) -> bool:
        """Return whether a picture lies elsewhere than the others, since the camera turns."""
        if not self._images:
            return False
        last = Registration()
        last.set_background(self._last)
        return _lies_elsewhere(last, image, _TURNS) or _lies_elsewhere(
            self._registration, image, _TURNS_SLOWLY
        )

    def median(self, retired: Image | None) -> Image:
        """Return the median of the frames, at least one.

        Where some of them show the `retired` background, it is kept: people hide it in the others.
        """
        samples = np.stack(self._images)
        median = np.asarray(np.sort(samples, axis=0)[len(samples) // 2], dtype=np.uint8)
        if retired is not None:
            old = fit_tone_curves(self._images[0], retired).apply(retired)
            seen = np.mean([largest_difference(sample, old) < _SAME for sample in samples], axis=0)
            np.copyto(median, old, where=(seen >= _SEEN)[..., None])
        return median


def _lies_elsewhere(background: Registration, image: Image, least: float) -> bool:
    """Return whether the motion that most edges of a background follow is more than a share of the width.

    People who all walk one way move fewer of them; phase correlation may see hardly anything else.
    """
    motion, size = background.search(image), (image.shape[1], image.shape[0])
    return motion is None or motion.distance(STILL, size) > least * size[0]
