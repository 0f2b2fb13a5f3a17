"""What the cameras see and how well: every window's view quality, by camera and pulse."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview import TrackKey
from bestview.quality import Looks, Quality, QualitySettings, Seen, view_quality
from server.view.reading import CameraWindow
from server.wire.config import Config
from server.wire.fit import Fit

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SeenWindow:
    """One camera's tracks over one window of F frames, and how well each shows whom it follows.

    Attributes:
        keys: whose they are; T of them.
        first: the pulse of the first frame.
        quality: (F, T), NaN where hidden.
        terms: (terms, F, T) what it is made of, NaN where hidden.
    """

    keys: tuple[TrackKey, ...]
    first: int
    quality: Floats
    terms: Floats


@dataclass(frozen=True, slots=True)
class SeenFrame:
    """One frame of a camera: a place in the window that spoke of it last."""

    window: SeenWindow
    place: int


class Sight:
    """Weighs the views of every window as it comes, and keeps what was last said of each frame.

    A window's quality does not depend on who its tracks are, nor on other cameras: it is worked out once.
    ``homographies`` lead from each camera's own picture to the ground.
    """

    def __init__(
        self, config: Config, homographies: Mapping[str, Floats | None], fits: Mapping[str, Fit]
    ) -> None:
        self._settings: QualitySettings = config.view.quality
        self._size = (float(config.site.width), float(config.site.height))
        self._fps = config.site.fps
        self._homographies, self._fits = homographies, fits
        self._frames: dict[str, dict[int, SeenFrame]] = {camera: {} for camera in config.camera_ids}

    def put(self, windows: Iterable[CameraWindow]) -> None:
        """Take over what cameras said of an epoch."""
        told = [window for window in windows if window.boxes.shape[1]]
        if not told:
            return
        first = min(window.first for window in told)
        quality = self._weigh(told, first)
        # Frames first: the rows of one frame of one camera are what is asked for.
        values = np.where(np.isnan(quality.terms).all(axis=0), np.nan, quality.quality).transpose(2, 1, 0)
        terms = quality.terms.transpose(3, 0, 2, 1)
        for column, window in enumerate(told):
            tracks, frames = window.boxes.shape[:2]
            rows = slice(window.first - first, window.first - first + frames)
            seen = SeenWindow(
                window.keys,
                window.first,
                np.ascontiguousarray(values[column, rows, :tracks]),
                np.ascontiguousarray(terms[column, :, rows, :tracks]),
            )
            for place in range(frames):
                self._frames[window.message.camera][window.first + place] = SeenFrame(seen, place)

    def at(self, camera: str, pulse: int) -> SeenFrame | None:
        """Give what was last said of a camera's frame; None: nothing."""
        return self._frames[camera].get(pulse)

    def forget_before(self, pulse: int) -> None:
        """Let go of the frames before a pulse."""
        for frames in self._frames.values():
            for old in [known for known in frames if known < pulse]:
                del frames[old]

    def _weigh(self, windows: Sequence[CameraWindow], first: int) -> Quality:
        """Weigh the views of all windows at once; tracks and frames that one of them lacks are hidden."""
        frames = max(window.first + window.boxes.shape[1] for window in windows) - first
        most = max(len(window.keys) for window in windows)
        boxes = np.full((len(windows), frames, most, 4), np.nan)
        sure = np.zeros((most, len(windows)))
        sharp = np.full((most, len(windows)), np.nan)
        for column, window in enumerate(windows):
            tracks = window.message.tracks
            rows, count = slice(window.first - first, window.message.last - first + 1), len(tracks)
            boxes[column, rows, :count] = window.boxes.transpose(1, 0, 2)
            sharp[:count, column] = [np.nan if it.sharpness is None else it.sharpness for it in tracks]
            sure[:count, column] = np.clip([it.confidence for it in tracks], 0.0, 1.0)
        return view_quality(
            Seen(boxes.transpose(2, 1, 0, 3), sure, sharp),
            Looks(
                self._size,
                np.array([self._picture(window.message.camera) for window in windows]),
                [self._ground(window.message.camera) for window in windows],
                self._fps,
            ),
            self._settings,
        )

    def _picture(self, camera: str) -> tuple[float, float, float, float]:
        """Say where a camera's own picture lies in the site's: in its middle."""
        left, top = (float(side) for side in self._fits[camera].to_site(np.zeros(2)))
        return left, top, self._size[0] - left, self._size[1] - top

    def _ground(self, camera: str) -> Floats | None:
        """Give the homography from the site's picture."""
        own = self._homographies[camera]
        if own is None:
            return None
        (left, top), scale = self._fits[camera].to_site(np.zeros(2)), self._fits[camera].scale
        to_own = np.array([[1.0, 0.0, -left], [0.0, 1.0, -top], [0.0, 0.0, scale]]) / scale
        return np.asarray(own @ to_own)
