"""What is known of an object before the window: the source node s_n."""

from __future__ import annotations

from dataclasses import dataclass

from tracking.boxes import BOX_SIDES, Floats
from tracking.motion import Motion


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
    motion: Motion | None = None

    def __post_init__(self) -> None:
        if self.histogram.ndim != 1:
            raise ValueError(f"a template's histogram has shape (B,), not {self.histogram.shape}")
        if self.box is not None and self.box.shape != (BOX_SIDES,):
            raise ValueError(f"a template's box has shape (4,), not {self.box.shape}")
