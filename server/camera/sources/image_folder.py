"""A folder of images as a recording."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from server.camera.sources.base import Image, SourceEndedError
from server.camera.sources.missing_frames import MissingFrames
from server.media.letterbox import Letterbox
from server.system.errors import UserError, reason_of

log = logging.getLogger(__name__)

_ENDINGS = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp"})


class ImageFolder:
    """Returns image number ``pulse - offset`` in the order of the file names, upright according to EXIF.

    All are letterboxed to the size of the first one. An unreadable one is replaced by the previous one, and
    logged.

    Raises:
        UserError: the folder cannot be read, there is no image in it, or the first cannot be read.
    """

    recorded = True

    def __init__(self, path: str, offset: int, at_end: Literal["stop", "loop"]) -> None:
        self._path, self._offset, self._loop = path, offset, at_end == "loop"
        try:
            self._files = sorted(file for file in Path(path).iterdir() if file.suffix.lower() in _ENDINGS)
        except OSError as error:
            raise UserError(f"{path}: cannot read this folder: {reason_of(error)}") from error
        if not self._files:
            raise UserError(f"{path}: there are no images in this folder ({', '.join(sorted(_ENDINGS))})")
        first = _read(self._files[0])
        if first is None:
            raise UserError(f"{self._files[0]}: cannot read this image")
        self._newest = first
        self.size = (first.shape[1], first.shape[0])
        self._gaps = MissingFrames(path)
        self._resized = False
        """Whether an image of another size was logged."""

    def take(self, pulse: int) -> Image | None:
        """Return the image of a pulse; an unreadable one is replaced by the previous one."""
        index = pulse - self._offset
        if index < 0:
            return None
        if index >= len(self._files):
            self._log_unreadable()
            if not self._loop:
                raise SourceEndedError(self._path)
            index %= len(self._files)
        image = _read(self._files[index])
        if image is None:
            self._gaps.add_damaged(index)
        else:
            self._newest = self._fitted(image, self._files[index])
        return self._newest

    def pulse_by_frame_count(self, pulse: int) -> int:
        """Return the pulse at which this pulse's image is first shown."""
        index = pulse - self._offset
        return pulse if index < 0 else self._offset + index % len(self._files)

    def pulse_in_first_pass(self, pulse: int) -> int:
        """Return the pulse at which the image of a pulse is shown first, if it loops."""
        return self.pulse_by_frame_count(pulse)

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        """Read some of the images; one that cannot be read is left out."""
        files = [self._files[index] for index in indices if index < len(self._files)]
        images = ((_read(file), file) for file in files)
        return (self._fitted(image, file) for image, file in images if image is not None)

    def close(self) -> None:
        """Log how many files could not be read, once."""
        self._log_unreadable()

    def _fitted(self, image: Image, file: Path) -> Image:
        size = (image.shape[1], image.shape[0])
        if size == self.size:
            return image
        if not self._resized:
            self._resized = True
            log.warning(
                "%s is %dx%d, the first image %dx%d: all images are letterboxed to that size",
                *(file, *size, *self.size),
            )
        return Letterbox(size, self.size).image(image)

    def _log_unreadable(self) -> None:
        self._gaps.log_summary(len(self._files), 1.0)


def _read(file: Path) -> Image | None:
    try:
        data = np.fromfile(file, dtype=np.uint8)
    except OSError:
        return None
    # From memory: with a file name, OpenCV ignores the orientation of a TIFF.
    image = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    return None if image is None else np.asarray(image, dtype=np.uint8)
