"""Boxes in every frame: a person's blobs at samples, and interpolated along blobs between them."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np

from tracking.boxes import BOX_SIDES, Floats, iou

_MIN_IOU = 0.2
"""Least overlap (IoU) of a blob between two samples with the interpolated box."""


SampledBoxes = dict[int, list[tuple[int, Floats | None]]]
"""By person id: frames of samples, and the box `(4,)` there; None: absent."""


class BlobBoxHistory:
    """Blob boxes of the frames that are not final yet."""

    def __init__(self) -> None:
        self._boxes: dict[int, Floats] = {}

    def add(self, frame: int, boxes: Floats) -> None:
        """Store the boxes `(B, 4)` of a frame."""
        self._boxes[frame] = boxes

    def drop_through(self, frame: int) -> None:
        """Drop all frames up to this one."""
        self._boxes = {stored: boxes for stored, boxes in self._boxes.items() if stored > frame}

    def trajectory(self, samples: list[tuple[int, Floats | None]], first: int, last: int) -> Floats:
        """Return a person's boxes in the frames `first` to `last`, `(F, 4)`, NaN where absent.

        Args:
            samples: frames and the person's blob box `(4,)`, ascending; None: absent.
            first: the first frame.
            last: the last frame.
        """
        boxes = np.full((last - first + 1, BOX_SIDES), np.nan)
        frames = [frame for frame, _ in samples]
        for row, frame in enumerate(range(first, last + 1)):
            index = bisect_left(frames, frame)
            if index < len(samples) and samples[index][0] == frame:
                box = samples[index][1]
            elif index == 0:
                continue
            elif index == len(samples):
                # After the newest sample, follow the blobs from frame to frame.
                before = boxes[row - 1] if row else samples[-1][1]
                box = None if before is None or np.isnan(before[0]) else self._nearest_blob(frame, before)
            else:
                box = self._interpolated(frame, samples[index - 1], samples[index])
            if box is not None:
                boxes[row] = box
        return boxes

    def _interpolated(
        self, frame: int, before: tuple[int, Floats | None], after: tuple[int, Floats | None]
    ) -> Floats | None:
        """Return the blob nearest to the straight line between two samples, or the point on the line."""
        if before[1] is None or after[1] is None:
            return None
        share = (frame - before[0]) / (after[0] - before[0])
        return self._nearest_blob(frame, (1.0 - share) * before[1] + share * after[1])

    def _nearest_blob(self, frame: int, expected: Floats) -> Floats:
        """Return the box of the frame's blob that overlaps a box most, or that box if none does."""
        boxes = self._boxes.get(frame)
        if boxes is None or not len(boxes):
            return expected
        overlaps = iou(expected[None], boxes)
        best = int(overlaps.argmax())
        return boxes[best] if overlaps[best] >= _MIN_IOU else expected
