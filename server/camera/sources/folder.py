"""A folder of images as a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from server.camera.sources.base import Image, SourceEnded
from server.wire.errors import UserError

_ENDINGS = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp"})


class Folder:
    """Shows its image ``pulse - offset`` in the order of the file names.

    Raises:
        UserError: the folder cannot be read, there is no image in it, or the first cannot be read.
    """

    recorded = True

    def __init__(self, path: str, offset: int, at_end: Literal["stop", "loop"]) -> None:
        self._offset, self._loop = offset, at_end == "loop"
        try:
            self._files = sorted(file for file in Path(path).iterdir() if file.suffix.lower() in _ENDINGS)
        except OSError as error:
            raise UserError(f"{path}: cannot read this folder: {error.strerror}") from error
        if not self._files:
            raise UserError(f"{path}: there are no images in this folder ({', '.join(sorted(_ENDINGS))})")
        self._newest = _read(self._files[0])
        if self._newest is None:
            raise UserError(f"{self._files[0]}: cannot read this image")
        self.size = (self._newest.shape[1], self._newest.shape[0])

    def take(self, pulse: int) -> Image | None:
        """Give the image of a pulse; one that cannot be read shows as the one before it."""
        index = pulse - self._offset
        if index < 0:
            return None
        if index >= len(self._files):
            if not self._loop:
                raise SourceEnded(str(self._files[-1].parent))
            index %= len(self._files)
        image = _read(self._files[index])
        if image is not None:
            self._newest = image
        return self._newest

    def ahead(self, places: Sequence[int]) -> Iterator[Image]:
        """Read some of the images; one that cannot be read is left out."""
        images = (_read(self._files[place]) for place in places if place < len(self._files))
        return (image for image in images if image is not None)

    def close(self) -> None:
        """Nothing is held open."""


def _read(file: Path) -> Image | None:
    image = cv2.imread(str(file), cv2.IMREAD_COLOR)
    return None if image is None else np.asarray(image, dtype=np.uint8)
