"""What the cameras see and how well: every window's view quality, by camera and pulse."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from bestview import TrackKey
from bestview.quality import Looks, Quality, QualitySettings, Seen, view_quality
from server.wire.config import Config
from server.wire.fit import Fit
from server.wire.messages import CameraTracks

Floats = NDArray[np.float64]

_HIDDEN = (np.nan,) * 4


@dataclass(frozen=True, slots=True, eq=False)
class SeenWindow:
    """One camera's tracks over one window of F frames, and how well each shows whom it follows.

    Attributes:
        keys: whose they are; T of them.
        quality: (F, T), NaN where hidden.
        terms: (terms, F, T) what it is made of, NaN where hidden.
    """

    keys: tuple[TrackKey, ...]
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

    def put(self, messages: Mapping[str, tuple[CameraTracks, Sequence[TrackKey]]]) -> None:
        """Take over what cameras said of an epoch, and whose each of their tracks is."""
        told = {camera: it for camera, it in messages.items() if it[0].last >= it[0].first}
        if not told:
            return
        first = min(message.first for message, _ in told.values())
        quality = self._weigh([message for message, _ in told.values()], first)
        # Frames first: the rows of one frame of one camera are what is asked for.
        values = np.where(np.isnan(quality.terms).all(axis=0), np.nan, quality.quality).transpose(2, 1, 0)
        terms = quality.terms.transpose(3, 0, 2, 1)
        for column, (camera, (message, keys)) in enumerate(told.items()):
            rows, tracks = slice(message.first - first, message.last - first + 1), len(keys)
            window = SeenWindow(
                tuple(keys),
                np.ascontiguousarray(values[column, rows, :tracks]),
                np.ascontiguousarray(terms[column, :, rows, :tracks]),
            )
            for place, pulse in enumerate(range(message.first, message.last + 1)):
                self._frames[camera][pulse] = SeenFrame(window, place)

    def at(self, camera: str, pulse: int) -> SeenFrame | None:
        """Give what was last said of a camera's frame; None: nothing."""
        return self._frames[camera].get(pulse)

    def forget_before(self, pulse: int) -> None:
        """Let go of the frames before a pulse."""
        for frames in self._frames.values():
            for old in [known for known in frames if known < pulse]:
                del frames[old]

    def _weigh(self, messages: Sequence[CameraTracks], first: int) -> Quality:
        """Weigh the views of all windows at once; tracks and frames that one of them lacks are hidden."""
        frames = max(message.last for message in messages) - first + 1
        tracks = max(len(message.tracks) for message in messages)
        boxes = np.full((len(messages), frames, tracks, 4), np.nan)
        sure = np.zeros((tracks, len(messages)))
        sharp = np.full((tracks, len(messages)), np.nan)
        for column, message in enumerate(messages):
            rows, count = slice(message.first - first, message.last - first + 1), len(message.tracks)
            boxes[column, rows, :count] = read_boxes(message).transpose(1, 0, 2)
            sharp[:count, column] = [
                np.nan if track.sharpness is None else track.sharpness for track in message.tracks
            ]
            sure[:count, column] = np.clip([track.confidence for track in message.tracks], 0.0, 1.0)
        return view_quality(
            Seen(boxes.transpose(2, 1, 0, 3), sure, sharp),
            Looks(
                self._size,
                np.array([self._picture(message.camera) for message in messages]),
                [self._ground(message.camera) for message in messages],
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


def read_boxes(message: CameraTracks) -> Floats:
    """Give the boxes of a message: (T, F, 4), NaN where hidden."""
    frames = message.last - message.first + 1
    boxes = [box or _HIDDEN for track in message.tracks for box in track.boxes]
    flat = np.fromiter(chain.from_iterable(boxes), dtype=np.float64, count=4 * len(boxes))
    return flat.reshape(len(message.tracks), frames, 4)
