"""One update of all cameras' tracks, lined up frame by frame, on the ground where that is known."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bestview.association.keys import TrackKey
from bestview.geometry.ground_plane import (
    feet_cut_off,
    foot_covariance,
    foot_points,
    person_heights,
    to_ground,
    upright_from_overhead,
)


@dataclass(frozen=True, slots=True, eq=False)
class Glimpse:
    """How a track looks in consecutive frames in which nobody else is in the box.

    Attributes:
        first: the first of these frames.
        last: the last one.
        histogram: (B,) the mean of these frames' histograms.
    """

    first: int
    last: int
    histogram: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LocalTrack:
    """What is new and final of one track of one camera.

    Attributes:
        camera: name of the camera.
        local: number of the track, unique in its camera for the camera's lifetime.
        first: frame of row 0.
        boxes: (M, 4) left, top, right, bottom in pixels per frame; NaN rows where hidden.
        looks: where nobody else was in the box.
        picture_height: of the camera, pixels; lets feet cut off by the lower edge be told.
    """

    camera: str
    local: int
    first: int
    boxes: NDArray[np.float64]
    looks: tuple[Glimpse, ...] = ()
    picture_height: float = float("inf")

    @property
    def key(self) -> TrackKey:
        """Which track it is."""
        return TrackKey(self.camera, self.local)


@dataclass(frozen=True, slots=True)
class FootError:
    """How well boxes find the feet: standard deviations in shares of the box height."""

    sideways: float
    upwards: float


@dataclass(frozen=True, slots=True)
class Sightings:
    """T tracks over the W frames of an update.

    Attributes:
        keys: the tracks, sorted.
        first: frame of column 0.
        boxes: (T, W, 4) pixels, NaN where hidden.
        ground: (T, W, 2) ground units, NaN where hidden or without homography.
        spread: (T, W, 2, 2) covariance of `ground`, ground units squared, NaN likewise.
        heights: (T, W) guessed person heights in ground units, NaN likewise.
    """

    keys: tuple[TrackKey, ...]
    first: int
    boxes: NDArray[np.float64]
    ground: NDArray[np.float64]
    spread: NDArray[np.float64]
    heights: NDArray[np.float64]

    @property
    def visible(self) -> NDArray[np.bool_]:
        """(T, W): seen in that frame."""
        return np.asarray(~np.isnan(self.boxes[..., 3]))

    def crowded(self, over: float) -> NDArray[np.bool_]:
        """(T, W): somebody else of the same camera is in the box, by an overlap (IoU) above `over`."""
        most = np.zeros(self.boxes.shape[:2])
        for rows in self.cameras():
            most[rows] = _largest_overlap(self.boxes[rows])
        return np.asarray(most > over)

    def cameras(self) -> list[slice]:
        """Rows of each camera, in order."""
        names = [key.camera for key in self.keys]
        starts = [i for i, name in enumerate(names) if i == 0 or names[i - 1] != name]
        return [slice(start, end) for start, end in pairwise([*starts, len(names)])]


def _largest_overlap(boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest IoU of each of (N, W, 4) boxes with another one of the same frame: (N, W)."""
    one, two = boxes[:, None], boxes[None, :]
    wide = np.minimum(one[..., 2], two[..., 2]) - np.maximum(one[..., 0], two[..., 0])
    high = np.minimum(one[..., 3], two[..., 3]) - np.maximum(one[..., 1], two[..., 1])
    both = np.maximum(wide, 0.0) * np.maximum(high, 0.0)
    area = (boxes[..., 2] - boxes[..., 0]) * (boxes[..., 3] - boxes[..., 1])
    either = area[:, None] + area[None, :] - both
    share = np.divide(both, either, out=np.zeros(both.shape), where=(both > 0) & (either > 0))
    share[np.arange(len(boxes)), np.arange(len(boxes))] = 0.0
    return np.asarray(share.max(axis=1, initial=0.0))


def line_up(
    tracks: Sequence[LocalTrack],
    homographies: Mapping[str, NDArray[np.float64] | None],
    foot_error: FootError,
    overhead: Collection[str] = (),
) -> Sightings:
    """Put the tracks of one update on one time axis.

    Feet on the lower edge of the picture are not the person's, and stand nowhere that is known. In the boxes
    of cameras that look straight down, `overhead`, people stand in the middle.

    Raises:
        ValueError: a track given twice, boxes that are not (M, 4), a camera without an entry in
            `homographies`.
    """
    for track in tracks:
        _check(track, homographies)
    # Sorted by key: nothing below depends on the order in which tracks are given.
    by_key = {track.key: track for track in tracks}
    if len(by_key) < len(tracks):
        raise ValueError("one track is given twice in one update")
    keys = tuple(sorted(by_key))
    ordered = [by_key[key] for key in keys]
    first = min((track.first for track in ordered), default=0)
    width = max((track.first + len(track.boxes) for track in ordered), default=0) - first
    boxes = np.full((len(keys), width, 4), np.nan)
    for i, track in enumerate(ordered):
        boxes[i, track.first - first :][: len(track.boxes)] = track.boxes
    ground = np.full((len(keys), width, 2), np.nan)
    spread = np.full((len(keys), width, 2, 2), np.nan)
    heights = np.full((len(keys), width), np.nan)
    matrices = [homographies[key.camera] for key in keys]
    rows = [i for i, matrix in enumerate(matrices) if matrix is not None]
    if rows:
        homography = np.array([matrices[i] for i in rows])[:, None]
        edge = np.array([ordered[i].picture_height for i in rows])[:, None]
        above = np.array([keys[i].camera in overhead for i in rows])
        upright = boxes[rows]
        upright[above] = upright_from_overhead(upright[above])
        whole = np.where(feet_cut_off(upright, edge)[..., None], np.nan, upright)
        ground[rows] = to_ground(homography, foot_points(whole))
        spread[rows] = foot_covariance(homography, whole, foot_error.sideways, foot_error.upwards)
        heights[rows] = person_heights(homography, whole)
    return Sightings(keys, first, boxes, ground, spread, heights)


def _check(track: LocalTrack, homographies: Mapping[str, NDArray[np.float64] | None]) -> None:
    name = f"track {track.local} of camera {track.camera}"
    if track.camera not in homographies:
        raise ValueError(f"{name}: the camera is not known here")
    if track.boxes.ndim != 2 or track.boxes.shape[1] != 4:  # noqa: PLR2004 — left, top, right, bottom
        raise ValueError(f"{name}: boxes have shape {track.boxes.shape}, not (M, 4)")
    for look in track.looks:
        if look.histogram.ndim != 1:
            raise ValueError(f"{name}: a histogram has shape {look.histogram.shape}, not (B,)")
        if not track.first <= look.first <= look.last < track.first + len(track.boxes):
            raise ValueError(f"{name}: a look of frames {look.first} to {look.last} is not of its frames")
