"""State of a tracked object before the window: the source node s_n."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.model.motion import MotionModel


@dataclass(frozen=True, slots=True, eq=False)
class Template:
    """An object's appearance, and its place in the frame before the window (paper II.B, II.E).

    Attributes:
        id: the object's number.
        histogram: (B,) float64, summing to 1; B = 0: no appearance is known.
        box: (4,) pixels; None: hidden or away in that frame, so that arcs from the source cost what arcs
            from an occlusion node do.
        motion: how it moved until it was last seen; None: not known.

    Raises:
        ValueError: the box has not 4 numbers, or the histogram is not one row.
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


# Sightings that the velocity is taken from.
_HISTORY_LENGTH = 12


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """An object in one final frame.

    Attributes:
        frame: the frame number.
        box: `(4,)` pixels.
        histogram: `(B,)` of that box.
        is_isolated: no other object is close enough to be in the box.
    """

    frame: int
    box: Floats
    histogram: Floats
    is_isolated: bool


class TrackedObject:
    """One entry of the object list.

    Attributes:
        id: its number.
        histogram: `(B,)`, its template, renewed by every sighting.
        box: `(4,)`, where it was last seen.
        frame: the frame in which that was.
        is_confirmed: it was seen in a final frame; before that it may vanish.
        present: it was seen in the last final frame.
    """

    __slots__ = ("_past", "box", "frame", "histogram", "id", "is_confirmed", "present")

    def __init__(self, number: int, histogram: Floats, box: Floats, frame: int) -> None:
        self.id = number
        self.histogram = histogram
        self.box = box
        self.frame = frame
        self._past: deque[tuple[int, Floats]] = deque(maxlen=_HISTORY_LENGTH)
        self.is_confirmed = False
        self.present = False

    def copy(self) -> TrackedObject:
        """Return a copy, to go back to."""
        other = TrackedObject(self.id, self.histogram, self.box, self.frame)
        other._past.extend(self._past)
        other.is_confirmed, other.present = self.is_confirmed, self.present
        return other

    def template(self, first: int) -> Template:
        """Return the source node of a window that begins with the frame `first`.

        It has no place where the object is hidden in the last final frame.
        """
        motion = None
        if self._past:
            frames, boxes = zip(*self._past, strict=True)
            motion = MotionModel.of(frames, np.stack(boxes), first)
        return Template(self.id, self.histogram, self.box if self.present else None, motion)

    def update(self, sighting: Sighting, rate: float) -> None:
        """Take over what one final frame shows; `rate` is the template's share that it renews.

        Where others are close, the box holds some of them: it does not enter the template.
        """
        self.box = sighting.box
        self._past.append((sighting.frame, sighting.box))
        self.frame = sighting.frame
        self.is_confirmed = True
        if sighting.is_isolated and self.histogram.size:
            self.histogram = (1.0 - rate) * self.histogram + rate * sighting.histogram

    def restart_at(self, box: Floats, frame: int) -> None:
        """Restart at the place where the object was re-identified, without its old motion."""
        self.box = box
        self.frame = frame
        self._past.clear()

    def frames_occluded(self, frame: int) -> int:
        """Return for how many frames it has not been seen at `frame`."""
        return max(frame - self.frame, 0)


def mean_histogram(histograms: Floats) -> Floats:
    """Return the mean of histograms `(K, B)`, `(B,)`, summing to 1."""
    mean = histograms.mean(axis=0)
    total = float(mean.sum())
    return np.asarray(mean / total) if total > 0.0 else np.asarray(mean)
