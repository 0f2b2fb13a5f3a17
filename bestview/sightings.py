"""One window of all cameras' tracks, lined up frame by frame, on the ground where that is known."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.evidence import TrackKey
from bestview.ground import feet, foot_spread, person_heights, to_ground
from bestview.succession import Place

_MIN_COMMON_FRAMES = 3
"""Frames in which two tracks must both be seen before their places are compared."""

_EDGE = 0.01
"""Share of the picture's height, on both sides of its lower edge, in which feet count as cut off."""


@dataclass(frozen=True, slots=True)
class LocalTrack:
    """One track of one camera in one window.

    Attributes:
        camera: name of the camera.
        local: number of the track, unique in its camera for the camera's lifetime.
        first: frame of row 0.
        boxes: (M, 4) left, top, right, bottom in pixels per frame; NaN rows where hidden.
        histogram: (B,) appearance; all zeros: unknown.
        picture_height: of the camera, pixels; lets feet cut off by the lower edge be told.
    """

    camera: str
    local: int
    first: int
    boxes: NDArray[np.float64]
    histogram: NDArray[np.float64]
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
    """T tracks over the W frames that end with the update.

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

    def present(self, since: int, last_frame: int) -> NDArray[np.bool_]:
        """(T,): seen in some frame after `since`, the windows ending with `last_frame`."""
        fresh = min(last_frame - since, self.boxes.shape[1])
        return np.asarray(self.visible[:, self.boxes.shape[1] - fresh :].any(axis=1))

    def places(self, track: int) -> tuple[Place, Place]:
        """Where a track (by row), seen at least once, was first and last seen."""
        columns = np.flatnonzero(self.visible[track])[[0, -1]].tolist()
        first, last = (Place(self.first + w, self.boxes[track, w], self.ground[track, w]) for w in columns)
        return first, last

    def same_camera(self) -> NDArray[np.bool_]:
        """(T, T): tracks of one camera."""
        names = sorted({key.camera for key in self.keys})
        camera = np.array([names.index(key.camera) for key in self.keys], dtype=np.int64)
        return np.asarray(camera[:, None] == camera[None, :])

    def side_by_side(self) -> NDArray[np.bool_]:
        """(T, T): two tracks of one camera, both seen in some frame: two people."""
        seen = self.visible.astype(np.float64)
        both = (seen @ seen.T > 0) & self.same_camera()
        np.fill_diagonal(both, val=False)
        return np.asarray(both)

    def distances(self, gate: float) -> NDArray[np.float64]:
        """Mean distance on the ground in gates, over the frames in which both are seen: (T, T).

        Where feet are uncertain the gate is stretched by their covariance: along the lines of sight.
        NaN: seen together in too few frames.
        """
        tracks, frames = self.ground.shape[:2]
        total, count = np.zeros((tracks, tracks)), np.zeros((tracks, tracks))
        for frame in range(frames):
            at, spread = self.ground[:, frame], self.spread[:, frame]
            dx, dy = (at[:, None, axis] - at[None, :, axis] for axis in (0, 1))
            xx, xy, yy = (spread[:, None, i, j] + spread[None, :, i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
            xx, yy = xx + gate**2, yy + gate**2
            # Length of (dx, dy) in the metric of the inverse covariance, the 2x2 inverse written out.
            squared = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)
            known = ~np.isnan(squared)
            total += np.where(known, np.sqrt(np.maximum(squared, 0.0)), 0.0)
            count += known
        return np.where(count >= _MIN_COMMON_FRAMES, total / np.maximum(count, 1), np.nan)


def line_up(
    tracks: Sequence[LocalTrack],
    homographies: Mapping[str, NDArray[np.float64] | None],
    last_frame: int,
    foot_error: FootError,
) -> Sightings:
    """Put the tracks of one update on one time axis that ends with `last_frame`.

    Feet on the lower edge of the picture are not the person's: they stand below it, and nowhere that is
    known. A box that reaches beyond the edge was guessed by somebody who knew, and is believed.

    Raises:
        ValueError: a track given twice, boxes that are not (M, 4), rows beyond `last_frame`, a camera
            without an entry in `homographies`.
    """
    ordered = sorted(tracks, key=lambda track: track.key)
    for track in ordered:
        _check(track, homographies, last_frame)
    keys = tuple(track.key for track in ordered)
    if len(dict.fromkeys(keys)) < len(keys):
        raise ValueError("one track is given twice in one update")
    width = max((last_frame + 1 - track.first for track in ordered), default=0)
    boxes = np.full((len(keys), width, 4), np.nan)
    ground = np.full((len(keys), width, 2), np.nan)
    spread = np.full((len(keys), width, 2, 2), np.nan)
    heights = np.full((len(keys), width), np.nan)
    for i, track in enumerate(ordered):
        start = track.first - (last_frame + 1 - width)
        boxes[i, start : start + len(track.boxes)] = track.boxes
        homography = homographies[track.camera]
        if homography is not None:
            cut = np.abs(boxes[i, :, 3:] / track.picture_height - 1.0) < _EDGE
            whole = np.where(cut, np.nan, boxes[i])
            ground[i] = to_ground(homography, feet(whole))
            spread[i] = foot_spread(homography, whole, foot_error.sideways, foot_error.upwards)
            heights[i] = person_heights(homography, whole)
    return Sightings(keys, last_frame + 1 - width, boxes, ground, spread, heights)


def _check(
    track: LocalTrack, homographies: Mapping[str, NDArray[np.float64] | None], last_frame: int
) -> None:
    name = f"track {track.local} of camera {track.camera}"
    if track.camera not in homographies:
        raise ValueError(f"{name}: the camera is not known here")
    if track.boxes.ndim != 2 or track.boxes.shape[1] != 4:  # noqa: PLR2004 — left, top, right, bottom
        raise ValueError(f"{name}: boxes have shape {track.boxes.shape}, not (M, 4)")
    if track.histogram.ndim != 1:
        raise ValueError(f"{name}: the histogram has shape {track.histogram.shape}, not (B,)")
    if track.first + len(track.boxes) - 1 > last_frame:
        raise ValueError(f"{name} reaches beyond frame {last_frame}")


class HeightScale:
    """How long a person's height is in units of the ground plane, from the boxes seen so far."""

    _REMEMBERED = 200

    def __init__(self) -> None:
        self._medians: deque[float] = deque(maxlen=self._REMEMBERED)

    def learn(self, heights: NDArray[np.float64]) -> None:
        """Take in guessed heights of any shape, NaN where unknown."""
        known = heights[np.isfinite(heights) & (heights > 0)]
        if known.size:
            self._medians.append(float(np.median(known)))

    @property
    def height(self) -> float:
        """Median of the updates' medians, in ground units; NaN before anybody was seen."""
        return float(np.median(np.array(self._medians))) if self._medians else float("nan")
