"""Walks: tracks of walking people in one camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bestview.calibration.homography import Floats
from bestview.calibration.walk_settings import comparison_step


@dataclass(frozen=True, slots=True)
class WalkTrack:
    """A person's boxes in successive frames.

    Attributes:
        first_frame: the frame of the first box.
        boxes: (F, 4) left, top, right, bottom in pixels; NaN: not detected, or unusable.
    """

    first_frame: int
    boxes: Floats

    @property
    def end_frame(self) -> int:
        """The frame after the last."""
        return self.first_frame + len(self.boxes)

    def at(self, times: Floats) -> Floats:
        """Interpolate the boxes at times that may lie between frames: (N,) -> (N, 4), NaN: no box."""
        place = np.asarray(times, dtype=np.float64) - self.first_frame
        inside = (place >= 0) & (place <= len(self.boxes) - 1)
        low = np.clip(np.floor(place), 0, len(self.boxes) - 1).astype(np.intp)
        high = np.minimum(low + 1, len(self.boxes) - 1)
        share = np.clip(place - low, 0.0, 1.0)[:, None]
        # A neighbor of weight 0 does not count, even if it is NaN.
        between = np.where(
            share > 0, (1 - share) * self.boxes[low] + share * self.boxes[high], self.boxes[low]
        )
        return np.where(inside[:, None], between, np.nan)


@dataclass(frozen=True, slots=True)
class Walk:
    """Tracks of one camera.

    Attributes:
        camera: its name.
        size: width and height of its picture, pixels.
        tracks: of people.
    """

    camera: str
    size: tuple[int, int]
    tracks: tuple[WalkTrack, ...]

    @property
    def end_frame(self) -> int:
        """The frame after the last one with a person."""
        return max((track.end_frame for track in self.tracks), default=0)


def build_walk(
    camera: str,
    size: tuple[int, int],
    frames: Sequence[int],
    ids: Sequence[int],
    boxes: Floats,
    fps: float,
) -> Walk:
    """Build the walk of a camera from rows of detections, without boxes that the picture's edge cuts off.

    Boxes are averaged over a moment, so that lifted feet do not count as movement.

    Args:
        camera: its name.
        size: width and height of its picture, pixels.
        frames: (N,) the frame of each row.
        ids: (N,) the track of each row.
        boxes: (N, 4) left, top, right, bottom of each row in pixels.
        fps: frames a second. A gap longer than the `step` of `WalkSettings` splits a track; the boxes of
            shorter ones are interpolated.
    """
    averaging_frames = comparison_step(fps)
    frame, track_id = np.asarray(frames, dtype=np.intp), np.asarray(ids, dtype=np.intp)
    inside = ~boxes_at_edge(boxes, size)
    tracks = []
    for number in np.unique(track_id):
        rows = np.flatnonzero((track_id == number) & inside)
        rows = rows[np.argsort(frame[rows], kind="stable")]
        # Across a long gap the tracker may have confused people.
        parts = np.split(rows, np.flatnonzero(np.diff(frame[rows]) > averaging_frames) + 1)
        tracks += [_track(frame[part], boxes[part], averaging_frames) for part in parts if len(part) > 1]
    return Walk(camera, size, tuple(sorted(tracks, key=lambda track: (track.first_frame, track.end_frame))))


def boxes_at_edge(boxes: Floats, size: tuple[int, int]) -> np.ndarray:
    """Return which boxes reach the picture's edge, where foot point, height and middle are unknown.

    (N, 4) pixels of a picture of width and height -> (N,).
    """
    width, height = size
    margin = max(1.0, 0.004 * height)
    left, top, right, bottom = boxes.T
    return np.asarray(
        (left <= margin) | (top <= margin) | (right >= width - margin) | (bottom >= height - margin)
    )


def _track(frames: np.ndarray, boxes: Floats, averaging_frames: int) -> WalkTrack:
    every = np.arange(frames[0], frames[-1] + 1)
    filled = np.column_stack([np.interp(every, frames, side) for side in boxes.T])
    return WalkTrack(int(frames[0]), _moving_average(filled, averaging_frames // 2))


def _moving_average(boxes: Floats, half: int) -> Floats:
    """Average over `half` frames before and after, over fewer at the ends."""
    sums = np.concatenate([np.zeros((1, 4)), boxes.cumsum(axis=0)])
    index = np.arange(len(boxes))
    reach = np.minimum(half, np.minimum(index, len(boxes) - 1 - index))
    low, high = index - reach, index + reach + 1
    return np.asarray((sums[high] - sums[low]) / (high - low)[:, None])


def time_reversed(walk: Walk) -> Walk:
    """Return the walk with time running backwards, within the same frames."""
    return replace(
        walk,
        tracks=tuple(WalkTrack(walk.end_frame - track.end_frame, track.boxes[::-1]) for track in walk.tracks),
    )


def halves_swapped(walk: Walk) -> Walk:
    """Return the walk with its second half before its first."""
    half = walk.end_frame // 2
    parts = []
    for track in walk.tracks:
        cut = min(max(half - track.first_frame, 0), len(track.boxes))
        parts += [WalkTrack(track.first_frame + walk.end_frame - half, track.boxes[:cut])] if cut > 1 else []
        parts += (
            [WalkTrack(track.first_frame + cut - half, track.boxes[cut:])]
            if len(track.boxes) - cut > 1
            else []
        )
    return replace(walk, tracks=tuple(parts))
