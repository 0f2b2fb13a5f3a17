"""A simulated camera with a main stream and a substream of the same walker, over RTSP."""

from __future__ import annotations

import time
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fakes.media.rtsp_camera import RtspCamera
from server.camera.encoder import AccessUnit, Encoder
from server.config.sections import EncodeSettings, SiteSettings

FPS = 25
GOP = 10
MAIN, SUB = (320, 192), (160, 96)
FRAMES = 100
"""Frames until it begins again."""
_STEP = 3
"""Pixels of the main picture by which the walker moves per frame."""
_WALKER = (12, 48)
"""Its width and height in the main picture."""

Picture = NDArray[np.uint8]


def walker_picture(frame: int, size: tuple[int, int]) -> Picture:
    """Draw a frame at a size: a bright walker before a dark wall with panels."""
    scale = size[0] / MAIN[0]
    rows, columns = np.arange(size[1]) * 6 // size[1], np.arange(size[0]) * 10 // size[0]
    gray = 25 + 15 * ((2 * rows[:, None] + 3 * columns[None]) % 5)
    picture = np.repeat(gray.astype(np.uint8)[..., None], 3, axis=2)
    left, top = round((4 + _STEP * (frame % FRAMES)) * scale), round(70 * scale)
    picture[top : top + round(_WALKER[1] * scale), left : left + round(_WALKER[0] * scale)] = 230
    return picture


def walker_frame(picture: Picture) -> float:
    """Return the number of the frame that a picture of any size shows."""
    columns = np.nonzero((picture[..., 1] > 135).any(axis=0))[0]
    return float((columns.mean() + 0.5) * MAIN[0] / picture.shape[1] - 4 - _WALKER[0] / 2) / _STEP


def walker_box(frame: float) -> tuple[float, float, float, float]:
    """Return the walker's box in the main picture."""
    left, top = 4 + _STEP * (frame % FRAMES), 70
    return left, top, left + _WALKER[0], top + _WALKER[1]


@cache
def walker_gops(size: tuple[int, int]) -> list[list[AccessUnit]]:
    """Encode the frames at a size in GOPs."""
    encoder = Encoder(
        SiteSettings(width=size[0], height=size[1], fps=FPS), EncodeSettings(gop_s=GOP / FPS, crf=18)
    )
    units = [encoder.encode(frame, walker_picture(frame, size)) for frame in range(FRAMES)]
    return [units[first : first + GOP] for first in range(0, FRAMES, GOP)]


class TwoStreamCamera:
    """Serves both streams live, each with a delay of its own; with ``reports``, RTCP sender reports."""

    def __init__(self, *, main_delay_s: float = 0.0, sub_delay_s: float = 0.0, reports: bool = True) -> None:
        self._began, self._reports, self._sub_delay_s = time.monotonic(), reports, sub_delay_s
        self.main = self._serve(MAIN, main_delay_s)
        self.sub = self._serve(SUB, sub_delay_s)
        self._sub_port = int(self.sub.url.rpartition(":")[2].partition("/")[0])

    def _serve(self, size: tuple[int, int], delay_s: float, port: int = 0) -> RtspCamera:
        return RtspCamera(
            walker_gops(size),
            FPS,
            live=True,
            began=self._began,
            delay_s=delay_s,
            reports=self._reports,
            port=port,
        )

    def restart_substream(self) -> None:
        """Serve the substream again, at the same address."""
        self.sub = self._serve(SUB, self._sub_delay_s, self._sub_port)

    def close(self) -> None:
        """Stop both streams."""
        self.main.close()
        self.sub.close()
