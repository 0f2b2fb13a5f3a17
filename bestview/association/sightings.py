"""One update of all cameras' tracks, aligned frame by frame and projected to the ground plane."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bestview.association.tracklet import TrackKey
from bestview.geometry.ground_plane import (
    feet_cut_off,
    foot_covariance,
    foot_points,
    person_heights,
    to_ground,
    upright_from_overhead,
)


@dataclass(frozen=True, slots=True, eq=False)
class AppearanceHistogram:
    """Mean color histogram of a track over consecutive frames in which no other person is in its box.

    Attributes:
        first_frame: the first of these frames.
        last_frame: the last one.
        histogram: (B,) the mean of these frames' histograms.
        camera: that saw them; None: the track's own. A track on the ground is seen by several.
    """

    first_frame: int
    last_frame: int
    histogram: NDArray[np.float64]
    camera: str | None = None


@dataclass(frozen=True, slots=True)
class TrackUpdate:
    """New final frames of one track of one camera.

    Attributes:
        camera: name of the camera.
        local_id: the camera's id of the track, unique in the camera's lifetime.
        first_frame: frame of row 0.
        boxes: (M, 4) left, top, right, bottom in pixels per frame; NaN rows where hidden.
        appearance: mean histograms of frames in which no other person is in the box.
        picture_height: of the camera, pixels; feet at the lower edge are cut off.
        detected: by camera, (M,) the frames in which it detects somebody whom several track together; None:
            a track of one camera, which detects them wherever there is a box.
    """

    camera: str
    local_id: int
    first_frame: int
    boxes: NDArray[np.float64]
    appearance: tuple[AppearanceHistogram, ...] = ()
    picture_height: float = float("inf")
    detected: Mapping[str, NDArray[np.bool_]] | None = None

    @property
    def key(self) -> TrackKey:
        """The track's key."""
        return TrackKey(self.camera, self.local_id)


@dataclass(frozen=True, slots=True)
class FootPointError:
    """Localization error of foot points: standard deviations as shares of the box height."""

    sideways: float
    upwards: float


@dataclass(frozen=True, slots=True)
class TrackObservations:
    """Observations of T tracks over the W frames of an update.

    Attributes:
        keys: the tracks, sorted.
        first_frame: frame of column 0.
        boxes: (T, W, 4) pixels, NaN where hidden.
        ground_point: (T, W, 2) ground units, NaN where hidden or without homography.
        ground_covariance: (T, W, 2, 2) of `ground_point`, ground units squared, NaN likewise.
        person_heights: (T, W) estimated person heights in ground units, NaN likewise.
        detected: by row and camera, (W,) the frames in which it detects somebody whom several track together.
    """

    keys: tuple[TrackKey, ...]
    first_frame: int
    boxes: NDArray[np.float64]
    ground_point: NDArray[np.float64]
    ground_covariance: NDArray[np.float64]
    person_heights: NDArray[np.float64]
    detected: Mapping[int, Mapping[str, NDArray[np.bool_]]] = field(default_factory=dict)

    def count_detections(self, row: int, start: int, stop: int) -> dict[str, int]:
        """Count the detections of a track in the columns from `start` to `stop`, in all of which it is seen.

        Returns:
            By camera; those without any are left out.
        """
        if row not in self.detected:
            return {self.keys[row].camera: stop - start}
        counts = {camera: int(found[start:stop].sum()) for camera, found in self.detected[row].items()}
        return {camera: count for camera, count in counts.items() if count}

    @property
    def visible(self) -> NDArray[np.bool_]:
        """(T, W) frames with a box."""
        return np.asarray(~np.isnan(self.boxes[..., 3]))

    def crowded(self, over: float) -> NDArray[np.bool_]:
        """Return where another track of the same camera overlaps by an IoU above `over`: (T, W)."""
        most = np.zeros(self.boxes.shape[:2])
        for rows in self.cameras():
            most[rows] = _largest_iou(self.boxes[rows])
        return np.asarray(most > over)

    def cameras(self) -> list[slice]:
        """Return the rows of each camera, in order."""
        names = [key.camera for key in self.keys]
        starts = [i for i, name in enumerate(names) if i == 0 or names[i - 1] != name]
        return [slice(start, end) for start, end in pairwise([*starts, len(names)])]


def _largest_iou(boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the largest IoU of each of (N, W, 4) boxes with another one of the same frame: (N, W)."""
    first, second = boxes[:, None], boxes[None, :]
    width = np.minimum(first[..., 2], second[..., 2]) - np.maximum(first[..., 0], second[..., 0])
    height = np.minimum(first[..., 3], second[..., 3]) - np.maximum(first[..., 1], second[..., 1])
    both = np.maximum(width, 0.0) * np.maximum(height, 0.0)
    area = (boxes[..., 2] - boxes[..., 0]) * (boxes[..., 3] - boxes[..., 1])
    either = area[:, None] + area[None, :] - both
    share = np.divide(both, either, out=np.zeros(both.shape), where=(both > 0) & (either > 0))
    share[np.arange(len(boxes)), np.arange(len(boxes))] = 0.0
    return np.asarray(share.max(axis=1, initial=0.0))


def align_tracks(
    tracks: Sequence[TrackUpdate],
    homographies: Mapping[str, NDArray[np.float64] | None],
    foot_error: FootPointError,
    overhead: Collection[str] = (),
) -> TrackObservations:
    """Align the tracks of one update on one time axis and project their foot points to the ground.

    Feet at the lower edge of the picture are cut off and have no ground point. In the boxes of cameras
    that look straight down, `overhead`, people stand in the middle.

    Raises:
        ValueError: a track that occurs twice, boxes that are not (M, 4), a camera without an entry in
            `homographies`.
    """
    for track in tracks:
        _check(track, homographies)
    # Sorted by key, so that the result does not depend on the order of the tracks.
    by_key = {track.key: track for track in tracks}
    if len(by_key) < len(tracks):
        raise ValueError("a track occurs twice in one update")
    keys = tuple(sorted(by_key))
    ordered = [by_key[key] for key in keys]
    first = min((track.first_frame for track in ordered), default=0)
    width = max((track.first_frame + len(track.boxes) for track in ordered), default=0) - first
    boxes = np.full((len(keys), width, 4), np.nan)
    detected: dict[int, dict[str, NDArray[np.bool_]]] = {}
    for i, track in enumerate(ordered):
        begin, count = track.first_frame - first, len(track.boxes)
        boxes[i, begin:][:count] = track.boxes
        if track.detected is not None:
            around = begin, width - begin - count
            detected[i] = {camera: np.pad(frames, around) for camera, frames in track.detected.items()}
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
    return TrackObservations(keys, first, boxes, ground, spread, heights, detected)


def _check(track: TrackUpdate, homographies: Mapping[str, NDArray[np.float64] | None]) -> None:
    name = f"track {track.local_id} of camera {track.camera}"
    if track.camera not in homographies:
        raise ValueError(f"{name}: the camera is unknown")
    if track.boxes.ndim != 2 or track.boxes.shape[1] != 4:  # noqa: PLR2004 — left, top, right, bottom
        raise ValueError(f"{name}: boxes have shape {track.boxes.shape}, not (M, 4)")
    for camera, found in (track.detected or {}).items():
        if found.shape != (len(track.boxes),):
            raise ValueError(f"{name}: detections by {camera} are not of its {len(track.boxes)} frames")
    for appearance in track.appearance:
        if appearance.histogram.ndim != 1:
            raise ValueError(f"{name}: a histogram has shape {appearance.histogram.shape}, not (B,)")
        if (
            not track.first_frame
            <= appearance.first_frame
            <= appearance.last_frame
            < track.first_frame + len(track.boxes)
        ):
            raise ValueError(
                f"{name}: an appearance histogram of frames {appearance.first_frame} to "
                f"{appearance.last_frame} is not within its frames"
            )
