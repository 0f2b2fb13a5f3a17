"""One window of all cameras' tracks, lined up frame by frame, on the ground where that is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bestview.evidence import TrackKey
from bestview.ground import feet, foot_spread, person_heights, to_ground
from bestview.strangers import MIN_COMMON_FRAMES
from bestview.succession import Place

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

    @property
    def stands(self) -> NDArray[np.bool_]:
        """(T, W): seen in that frame, and where on the ground."""
        return np.asarray(~np.isnan(self.ground[..., 0] + self.spread[..., 0, 0]))

    def places(self, rows: Sequence[int]) -> list[tuple[Place, Place]]:
        """Where tracks (by row), each seen at least once, were first and last seen."""
        if not rows:
            return []
        visible = self.visible[rows]
        first = visible.argmax(axis=1)
        last = visible.shape[1] - 1 - visible[:, ::-1].argmax(axis=1)
        return list(zip(self._places(rows, first), self._places(rows, last), strict=True))

    def _places(self, rows: Sequence[int], column: NDArray[np.int64]) -> list[Place]:
        boxes, ground = self.boxes[rows, column], self.ground[rows, column]
        # Copies: a place is remembered for long, and must not keep a whole update.
        return [
            Place(self.first + frame, box.copy(), at.copy())
            for frame, box, at in zip(column.tolist(), boxes, ground, strict=True)
        ]

    def cameras(self) -> list[slice]:
        """Rows of each camera, in order."""
        names = [key.camera for key in self.keys]
        starts = [i for i, name in enumerate(names) if i == 0 or names[i - 1] != name]
        return [slice(start, end) for start, end in pairwise([*starts, len(names)])]

    def side_by_side(self, rows: slice) -> NDArray[np.bool_]:
        """(N, N) for one camera's N rows: both seen in some frame, two people."""
        seen = self.visible[rows].astype(np.float32)
        both = seen @ seen.T > 0
        np.fill_diagonal(both, val=False)
        return np.asarray(both)

    def distances(self, one: NDArray[np.int64], two: NDArray[np.int64], gate: float) -> NDArray[np.float64]:
        """Mean distance on the ground in gates, over the frames in which both are seen: (P,) pairs -> (P,).

        Where feet are uncertain the gate is stretched by their covariance: along the lines of sight.
        NaN: seen together in too few frames.
        """
        total, count = np.zeros(one.shape), np.zeros(one.shape, dtype=np.int64)
        # (W, 5, T): what is read together lies together.
        parts = [self.ground[..., 0], self.ground[..., 1]]
        parts += [self.spread[..., i, j] for i, j in ((0, 0), (0, 1), (1, 1))]
        for x, y, *about in np.ascontiguousarray(np.moveaxis(np.array(parts), (1, 2), (2, 0))):
            dx, dy = x[one] - x[two], y[one] - y[two]
            xx, xy, yy = (part[one] + part[two] for part in about)
            xx, yy = xx + gate**2, yy + gate**2
            # Length of (dx, dy) in the metric of the inverse covariance, the 2x2 inverse written out.
            squared = (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)
            known = ~np.isnan(squared)
            total += np.where(known, np.sqrt(np.maximum(squared, 0.0)), 0.0)
            count += known
        return np.where(count >= MIN_COMMON_FRAMES, total / np.maximum(count, 1), np.nan)


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
    for track in tracks:
        _check(track, homographies, last_frame)
    # Sorted by key: nothing below depends on the order in which tracks are given.
    by_key = {track.key: track for track in tracks}
    if len(by_key) < len(tracks):
        raise ValueError("one track is given twice in one update")
    keys = tuple(sorted(by_key))
    ordered = [by_key[key] for key in keys]
    width = max((last_frame + 1 - track.first for track in ordered), default=0)
    boxes = np.full((len(keys), width, 4), np.nan)
    for i, track in enumerate(ordered):
        start = track.first - (last_frame + 1 - width)
        boxes[i, start : start + len(track.boxes)] = track.boxes
    ground = np.full((len(keys), width, 2), np.nan)
    spread = np.full((len(keys), width, 2, 2), np.nan)
    heights = np.full((len(keys), width), np.nan)
    matrices = [homographies[key.camera] for key in keys]
    rows = [i for i, matrix in enumerate(matrices) if matrix is not None]
    if rows:
        homography = np.array([matrices[i] for i in rows])[:, None]
        edge = np.array([ordered[i].picture_height for i in rows])[:, None, None]
        whole = np.where(np.abs(boxes[rows, :, 3:] / edge - 1.0) < _EDGE, np.nan, boxes[rows])
        ground[rows] = to_ground(homography, feet(whole))
        spread[rows] = foot_spread(homography, whole, foot_error.sideways, foot_error.upwards)
        heights[rows] = person_heights(homography, whole)
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
