"""View quality of every window, by camera and pulse."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.quality import CameraLayout, QualitySettings, TrackWindow, ViewQuality, compute_view_quality
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from server.messaging.camera_status import PictureMotion
from server.messaging.packed_arrays import PackedAreas, unpack_boxes
from server.messaging.picture_motion import moved_homography
from server.service.identity.camera_window import CameraWindow
from server.service.ingest.window_history import HistorySpan, WindowHistory
from tracking.boxes import BOX_SIDES, shares_within
from tracking.types import PictureCondition

Floats = NDArray[np.float64]

_END = 2**62


@dataclass(frozen=True, slots=True, eq=False)
class WindowQuality:
    """How well one camera's window of F frames shows the people of its T tracks.

    Attributes:
        window: the tracks.
        quality: (F, T), NaN where hidden.
        terms: (terms, F, T) the quality terms, NaN where hidden.
    """

    window: CameraWindow
    quality: Floats
    terms: Floats


class ViewQualityBuffer:
    """Computes the view quality of every window, and keeps the newest of each frame.

    A window's quality depends neither on person numbers nor on other cameras, so it is computed once.
    ``homographies`` map each camera's image to the ground.
    """

    def __init__(
        self, config: Config, homographies: Mapping[str, Floats | None], letterboxes: Mapping[str, Letterbox]
    ) -> None:
        self.settings: QualitySettings = config.view.quality
        self._size = (float(config.site.width), float(config.site.height))
        self._fps = config.site.fps
        self._homographies, self.letterboxes = homographies, letterboxes
        self._overhead = config.overhead
        self.conditions: dict[str, PictureCondition] = dict.fromkeys(config.camera_ids, "clear")
        """What is wrong with each camera's newest picture."""
        self._covered: dict[str, PackedAreas] = dict.fromkeys(config.camera_ids, b"")
        self._motion: dict[str, PictureMotion | None] = dict.fromkeys(config.camera_ids)
        self._histories = {camera: WindowHistory[WindowQuality]() for camera in config.camera_ids}

    def put(self, windows: Sequence[CameraWindow]) -> None:
        """Add the windows of an epoch."""
        for window in windows:
            self.conditions[window.message.camera] = window.message.condition
            self._covered[window.message.camera] = window.message.covered
            self._motion[window.message.camera] = window.message.motion
        for quality in self._qualities(windows):
            first, frames = quality.window.first, len(quality.quality)
            self._histories[quality.window.message.camera].put(quality, first, first + frames - 1)

    def change_settings(self, settings: QualitySettings) -> None:
        """Apply other settings, also to the windows in the buffer."""
        self.settings = settings
        for history in self._histories.values():
            for span in history.over(0, _END):
                (quality,) = self._qualities([span.window.window])
                history.put(quality, span.first, span.last)

    def over(self, camera: str, first: int, last: int) -> list[HistorySpan[WindowQuality]]:
        """Return the newest quality of a camera's frames from `first` to `last`."""
        return self._histories[camera].over(first, last)

    def clarity(self, camera: str, boxes: Floats) -> Floats:
        """Return how clear a camera's newest picture is in boxes (K, 4), (K,), from 0 to 1."""
        return _clarity(boxes[:, None], self.conditions[camera], self._covered[camera])

    def forget_before(self, pulse: int) -> None:
        """Drop the frames before a pulse."""
        for history in self._histories.values():
            history.forget_before(pulse)

    def _qualities(self, windows: Sequence[CameraWindow]) -> list[WindowQuality]:
        """Compute the quality of some windows, all at once."""
        if not windows:
            return []
        start = min(window.first for window in windows)
        computed = self._compute(windows, start)
        quality, terms = computed.quality.T, computed.terms.transpose(0, 2, 1)
        ends = np.cumsum([len(window.keys) for window in windows]).tolist()
        qualities = []
        for window, end in zip(windows, ends, strict=True):
            count, frames = window.boxes.shape[:2]
            rows, tracks = slice(window.first - start, window.first - start + frames), slice(end - count, end)
            qualities.append(WindowQuality(window, quality[rows, tracks], terms[:, rows, tracks]))
        return qualities

    def _compute(self, windows: Sequence[CameraWindow], start: int) -> ViewQuality:
        """Compute the quality of all windows' tracks; frames outside a window count as hidden."""
        tracks = [track for window in windows for track in window.message.tracks]
        clarity = [
            _clarity(window.boxes, window.message.condition, window.message.covered) for window in windows
        ]
        return compute_view_quality(
            TrackWindow(
                _stacked_boxes(windows, start),
                np.repeat(np.arange(len(windows)), [len(window.keys) for window in windows]),
                np.clip(np.array([track.confidence for track in tracks], dtype=np.float64), 0.0, 1.0),
                # None, not measured, becomes NaN.
                np.array([track.sharpness for track in tracks], dtype=np.float64),
                np.concatenate([np.empty(0), *clarity]),
            ),
            self.layout([window.message.camera for window in windows]),
            self.settings,
        )

    def layout(self, cameras: Sequence[str]) -> CameraLayout:
        """Return the layout of cameras whose image size is known."""
        pictures = np.array([self._picture(camera) for camera in cameras]).reshape(-1, 4)
        return CameraLayout(self._size, pictures, [self._ground(camera) for camera in cameras], self._fps)

    def _picture(self, camera: str) -> tuple[float, float, float, float]:
        """Return the rectangle of a camera's image, centered in the site's."""
        left, top = (float(side) for side in self.letterboxes[camera].camera_to_site(np.zeros(2)))
        return left, top, self._size[0] - left, self._size[1] - top

    def _ground(self, camera: str) -> Floats | None:
        """Return the homography from the site's image; None for overhead cameras: no one can face them."""
        return None if camera in self._overhead else self.ground(camera)

    def ground(self, camera: str) -> Floats | None:
        """Return the homography from the site's image, where the camera looks now; None: there is none."""
        homography = self._homographies[camera]
        if homography is None or camera not in self.letterboxes:
            return None
        (left, top), scale = (
            self.letterboxes[camera].camera_to_site(np.zeros(2)),
            self.letterboxes[camera].scale,
        )
        to_camera = np.array([[1.0, 0.0, -left], [0.0, 1.0, -top], [0.0, 0.0, scale]]) / scale
        return moved_homography(np.asarray(homography @ to_camera), self._motion[camera])


def _clarity(boxes: Floats, condition: PictureCondition, covered: PackedAreas) -> Floats:
    """Return how clear a picture is where each track's boxes (T, F, 4) are, (T,): 0 behind a cover."""
    if not covered or condition not in {"clear", "covered"}:
        return np.full(len(boxes), float(condition == "clear"))
    return 1.0 - _covered_shares(boxes, covered)


def _covered_shares(boxes: Floats, covered: PackedAreas) -> Floats:
    """Return the mean share of each track's boxes (T, F, 4) that is covered, (T,); 0 where all are hidden."""
    shares = shares_within(boxes.reshape(-1, BOX_SIDES), unpack_boxes([covered])).sum(axis=1)
    shares = shares.reshape(boxes.shape[:2])
    known = ~np.isnan(shares)
    return np.asarray(np.where(known, shares, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1))


def _stacked_boxes(windows: Sequence[CameraWindow], start: int) -> Floats:
    """Return the boxes of all tracks over the frames of all windows from `start` on: (T, N, 4)."""
    frames = max(window.first + window.boxes.shape[1] for window in windows) - start
    if all(window.boxes.shape[1] == frames for window in windows):
        return np.concatenate([window.boxes for window in windows])
    boxes = np.full((sum(len(window.keys) for window in windows), frames, 4), np.nan)
    end = 0
    for window in windows:
        count, frames_here = window.boxes.shape[:2]
        boxes[end : end + count, window.first - start : window.first - start + frames_here] = window.boxes
        end += count
    return boxes
