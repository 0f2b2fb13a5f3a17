"""Size term of view quality: the paper's, as a length."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.quality.boxes import Floats, areas_inside_picture


def size_quality(boxes: Floats, width: float, height: float) -> NDArray[np.float64]:
    """Return the linear size of the part of each box inside the picture: ``sqrt(box area / picture area)``.

    The paper's view quality is the size of the bounding box (section III). The root makes it proportional to
    nearness instead of its square, so that one very near view does not make all others look equally bad.

    Args:
        boxes: (..., 4) left, top, right, bottom in pixels; NaN where the object is hidden.
        width: of the picture, pixels.
        height: of the picture, pixels.

    Returns:
        (...) values in [0, 1]; 0 where hidden, outside the picture or empty.

    Raises:
        ValueError: a picture without area, or boxes whose last axis is not 4 long.
    """
    if not (width > 0 and height > 0):
        raise ValueError(f"a picture of {width} x {height} pixels has no area")
    if boxes.ndim < 1 or boxes.shape[-1] != 4:  # noqa: PLR2004 — left, top, right, bottom
        raise ValueError(f"boxes have shape {boxes.shape}, not (..., 4)")
    area = areas_inside_picture(boxes, np.array([0.0, 0.0, width, height]))
    return np.asarray(np.sqrt(np.nan_to_num(area) / (width * height)))
