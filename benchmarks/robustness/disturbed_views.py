"""A camera's recording with a disturbance from a frame on, and the truth of what can then be seen."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.robustness.disturbances.base import Affine, Disturbance, Floats, Moment
from server.camera.sources import FrameSource, Image
from tracking.motchallenge import MotRow

_MIN_SEEN = 0.5
"""Share of a box that must be in the picture and uncovered for its person to count."""


@dataclass(frozen=True, slots=True)
class Disturbed:
    """A disturbance of one camera.

    Attributes:
        disturbance: what happens.
        start: its first frame, from 0.
        fps: frames a second.
        seed: of what is random.
        camera: the camera's index.
    """

    disturbance: Disturbance
    start: int
    fps: float
    seed: int
    camera: int

    def moment(self, frame: int) -> Moment | None:
        """Return the moment of a frame, from 0; None: the frame is undisturbed."""
        seconds = (frame - self.start) / self.fps
        over = self.disturbance.lasts_s is not None and seconds >= self.disturbance.lasts_s
        if frame < self.start or over or (self.disturbance.one_camera and self.camera > 0):
            return None
        return Moment(frame - self.start, seconds, self.seed, self.camera)

    def truth(self, rows: Sequence[MotRow], size: tuple[int, int]) -> list[MotRow]:
        """Return the true boxes, moved with the picture; people who are not seen get the confidence 0."""
        changes: dict[int, tuple[Affine | None, Floats | None]] = {}
        seen = []
        for row in rows:
            moment = self.moment(row.frame - 1)
            if moment is not None:
                if row.frame not in changes:
                    motion = self.disturbance.motion(moment, size)
                    changes[row.frame] = motion, self.disturbance.cover(moment, size)
                seen.append(_changed(row, *changes[row.frame], size))
            else:
                seen.append(row)
        return seen


class DisturbedSource:
    """The frames of a source with a disturbance.

    Args:
        open_source: opens the source.
        disturbed: what happens, and when.
    """

    def __init__(self, open_source: Callable[[], FrameSource], disturbed: Disturbed) -> None:
        self._open = open_source
        self._source = open_source()
        self.size, self.recorded = self._source.size, self._source.recorded
        self._disturbed, self._effect = disturbed, disturbed.disturbance.begin()

    def change(self, disturbed: Disturbed) -> None:
        """Let something else happen, in a copy of the process that has opened the source."""
        self._source = self._open()  # copies of a process share the position in an open file
        self._disturbed, self._effect = disturbed, disturbed.disturbance.begin()

    def take(self, pulse: int) -> Image | None:
        """Return the disturbed picture of a pulse; None: there is none.

        Raises:
            SourceEndedError: the recording is over.
        """
        image = self._source.take(pulse)
        moment = self._disturbed.moment(pulse)
        return image if moment is None or image is None else self._effect(image, moment)

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        """Return the pictures from before the disturbance."""
        return self._source.prescan_images([index for index in indices if index < self._disturbed.start])

    def close(self) -> None:
        """Close the source."""
        self._source.close()


def _changed(row: MotRow, motion: Affine | None, cover: Floats | None, size: tuple[int, int]) -> MotRow:
    moved = row if motion is None else _moved(row, motion, size)
    return moved if cover is None else _uncovered(moved, cover)


def _moved(row: MotRow, matrix: Affine, size: tuple[int, int]) -> MotRow:
    """Return a box moved with its center and clipped to the picture; a person stays upright."""
    center = matrix @ np.array([row.left + row.width / 2.0, row.top + row.height / 2.0, 1.0])
    half = np.array([row.width, row.height]) / 2.0
    (left, top), (right, bottom) = np.clip([center - half, center + half], 0.0, size).tolist()
    inside = (right - left) * (bottom - top) / max(row.width * row.height, 1e-9)
    return _seen(replace(row, left=left, top=top, width=right - left, height=bottom - top), inside)


def _uncovered(row: MotRow, cover: Floats) -> MotRow:
    """Return a box with what a cover (H, W) leaves of its visible share."""
    left, top, right, bottom = (max(round(side), 0) for side in row.box)
    part = cover[top:bottom, left:right]
    return _seen(row, 1.0 - float(part.mean()) if part.size else 0.0)


def _seen(row: MotRow, share: float) -> MotRow:
    """Return a row of which only a share can be seen."""
    visible = row.visible * share if row.visible >= 0.0 else row.visible
    return replace(row, visible=visible, confidence=row.confidence if share >= _MIN_SEEN else 0.0)
