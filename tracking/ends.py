"""Whose track ends with a window."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats
from tracking.duplicates import duplicates
from tracking.templates import RememberedObject

_LEAST_SEEN = 3
"""A new object that is on so few of the window's frames once all are solved together was none."""


def ended(objects: Sequence[RememberedObject], boxes: Sequence[Floats], duplicate: float) -> set[int]:
    """Give the ids that end with this window: a second track on somebody, a new one that was none.

    `boxes` are everybody's, `(F, 4)` with NaN rows where hidden; `duplicate` as in `duplicates`.
    """
    gone = set(duplicates([item.id for item in objects], boxes, duplicate))
    for item, rows in zip(objects, boxes, strict=True):
        if not item.confirmed and np.count_nonzero(~np.isnan(rows[:, 0])) < _LEAST_SEEN:
            gone.add(item.id)
    return gone
