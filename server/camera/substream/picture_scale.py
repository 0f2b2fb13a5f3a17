"""The picture in which people are tracked, and its place in the site's: the only conversion between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from server.camera.sources.base import Image
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from server.messaging.messages import Box
from tracking.image_scaling import scale_image

_USUAL_WIDTH = 640
"""Width in pixels of a substream that has not answered yet."""

Size = tuple[int, int]
"""Width and height, pixels."""


class PictureScale:
    """Scales between the site's picture and a smaller one of the same view, in which people are tracked."""

    def __init__(self, tracked: Size, site: Size) -> None:
        self.tracked, self.site = tracked, site
        self.is_identity = tracked == site
        self._factors = np.array([site[0] / tracked[0], site[1] / tracked[1]])

    def image(self, image: Image) -> Image:
        """Return an image of the site's size at the tracked size."""
        return scale_image(image, self.tracked)

    def boxes_to_site(self, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map boxes (N, 4) of the tracked picture to the site's."""
        return boxes if self.is_identity else boxes * np.tile(self._factors, 2)

    def box_from_site(self, box: Box) -> Box:
        """Map a box of the site's picture to the tracked one."""
        if self.is_identity:
            return box
        left, top, right, bottom = (np.asarray(box) / np.tile(self._factors, 2)).tolist()
        return left, top, right, bottom

    def motion_to_site(self, motion: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a homography (3, 3) between tracked pictures as one between the site's."""
        if self.is_identity:
            return motion
        scale = np.diag([*self._factors, 1.0])
        return np.asarray(scale @ motion @ np.linalg.inv(scale))

    def config(self, config: Config) -> Config:
        """Return the configuration of a site whose pictures have the tracked size, for the detector."""
        if self.is_identity:
            return config
        ignore = tuple(
            tuple((x / float(self._factors[0]), y / float(self._factors[1])) for x, y in polygon)
            for polygon in config.detect.ignore
        )
        site = config.site.model_copy(update={"width": self.tracked[0], "height": self.tracked[1]})
        return config.model_copy(update={"site": site, "detect": replace(config.detect, ignore=ignore)})


def choose_scale(site: Size, main: Size, substream: Size | None) -> PictureScale:
    """Return the scale at which no pixel of the substream is lost, at most the site's.

    Args:
        site: size of the site's pictures.
        main: of the camera's video.
        substream: of the substream; None: not known yet.
    """
    _, _, width, height = Letterbox(main, site).content
    width_inside, height_inside = substream or (_USUAL_WIDTH, 1)
    share = min(1.0, max(width_inside / width, height_inside / height))
    tracked = max(1, round(site[0] * share)), max(1, round(site[1] * share))
    return PictureScale(tracked, site)


class SubstreamPlacement:
    """Places the substream's pictures where the same view lies in the tracked picture.

    Both streams show the same view, so the pictures are stretched to the main stream's shape. Where the
    substream declares that its pixels are not square, its shape is true instead: it shows a part of the main
    picture as wide or as high, in its middle.

    Args:
        main: size of the main stream's pictures.
        scale: of the tracked picture.
    """

    def __init__(self, main: Size, scale: PictureScale) -> None:
        self._tracked = scale.tracked
        self._content = Letterbox(main, scale.tracked).content

    def image(self, image: Image, shape: Size | None = None) -> Image:
        """Return the tracked picture of a picture of the substream, of any size.

        ``shape``: width and height in which it is to be shown; None: it does not say.
        """
        left, top, width, height = self._content
        if shape is not None:
            inner = Letterbox(shape, (width, height)).content
            left, top, width, height = left + inner[0], top + inner[1], inner[2], inner[3]
        scaled = scale_image(image, (width, height))
        if (width, height) == self._tracked:
            return scaled
        canvas = np.zeros((self._tracked[1], self._tracked[0], 3), dtype=np.uint8)
        canvas[top : top + height, left : left + width] = scaled
        return canvas
