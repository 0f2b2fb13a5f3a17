"""State of a tracked object before the window: the source node s_n."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.frame_rate import DEFAULT_FPS, frames_in
from tracking.model.motion import MotionModel


@dataclass(frozen=True, slots=True, eq=False)
class Template:
    """An object's appearance, and its box in the frame before the window (paper II.B, II.E).

    Attributes:
        id: the object's id.
        histogram: (B,) float64, summing to 1; B = 0: unknown appearance.
        box: (4,) pixels; None: occluded or absent in that frame, so that arcs from the source cost the same
            as arcs from an occlusion node.
        motion: its motion up to its last detection; None: unknown.

    Raises:
        ValueError: the box has not 4 numbers, the histogram is not one row, or a number is not finite.
    """

    id: int
    histogram: Floats
    box: Floats | None
    motion: MotionModel | None = None

    def __post_init__(self) -> None:
        if self.histogram.ndim != 1:
            raise ValueError(f"a template's histogram has shape (B,), not {self.histogram.shape}")
        if self.box is not None and self.box.shape != (BOX_SIDES,):
            raise ValueError(f"a template's box has shape (4,), not {self.box.shape}")
        numbers = self.histogram if self.box is None else np.concatenate([self.histogram, self.box])
        if not np.isfinite(numbers).all():
            raise ValueError(
                f"a template's box and histogram are finite numbers: object {self.id} has others"
            )


# Seconds of detections that determine the velocity, and their least number.
_HISTORY_S = 0.48
_MIN_HISTORY = 3


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """The detection of an object in one final frame.

    Attributes:
        frame: the frame number.
        box: `(4,)` pixels.
        histogram: `(B,)` of that box.
        is_isolated: no other object overlaps the box.
    """

    frame: int
    box: Floats
    histogram: Floats
    is_isolated: bool


class TrackedObject:
    """One entry of the object list.

    Attributes:
        id: its id.
        histogram: `(B,)`, its template, updated by every isolated detection.
        box: `(4,)`, its last detection.
        frame: the frame of its last detection.
        is_confirmed: it was detected in a final frame; before that it may be dropped.
        present: it was detected in the last final frame.
    """

    __slots__ = ("_fps", "_history", "box", "frame", "histogram", "id", "is_confirmed", "present")

    def __init__(
        self,
        number: int,
        histogram: Floats,
        box: Floats,
        frame: int,
        fps: float = DEFAULT_FPS,
    ) -> None:
        self.id = number
        self.histogram = histogram
        self.box = box
        self.frame = frame
        self._fps = fps
        history = frames_in(_HISTORY_S, fps, _MIN_HISTORY)
        self._history: deque[tuple[int, Floats]] = deque(maxlen=history)
        self.is_confirmed = False
        self.present = False

    def copy(self) -> TrackedObject:
        """Return a copy."""
        other = TrackedObject(self.id, self.histogram, self.box, self.frame, self._fps)
        other._history.extend(self._history)
        other.is_confirmed, other.present = self.is_confirmed, self.present
        return other

    def template(self, first: int) -> Template:
        """Return the source node of a window that begins with the frame `first`.

        It has no box if the object is occluded in the last final frame.
        """
        motion = None
        if self._history:
            frames, boxes = zip(*self._history, strict=True)
            motion = MotionModel.of(frames, np.stack(boxes), first, self._fps)
        return Template(self.id, self.histogram, self.box if self.present else None, motion)

    def update(self, sighting: Sighting, rate: float) -> None:
        """Update the state by a detection in a final frame; `rate` is the template's update rate.

        The template is only updated if no other object overlaps the box.
        """
        self.box = sighting.box
        self._history.append((sighting.frame, sighting.box))
        self.frame = sighting.frame
        self.is_confirmed = True
        if sighting.is_isolated and self.histogram.size:
            self.histogram = (1.0 - rate) * self.histogram + rate * sighting.histogram

    def restart_at(self, box: Floats, frame: int) -> None:
        """Restart at the box where the object was re-identified, without its previous motion."""
        self.box = box
        self.frame = frame
        self._history.clear()

    def frames_occluded(self, frame: int) -> int:
        """Return the number of frames since its last detection."""
        return max(frame - self.frame, 0)


def uniform_histogram(bins: int) -> Floats:
    """Return the histogram `(bins,)` of an object without any pixels, as `gray_histograms` has it."""
    return np.full(bins, 1.0 / max(bins, 1))


def mean_histogram(histograms: Floats) -> Floats:
    """Return the mean of histograms `(K, B)`, `(B,)`, summing to 1."""
    mean = histograms.mean(axis=0)
    total = float(mean.sum())
    return np.asarray(mean / total) if total > 0.0 else np.asarray(mean)
