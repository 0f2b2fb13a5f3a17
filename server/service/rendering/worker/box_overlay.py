"""Draws boxes and person numbers on a picture."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from server.messaging.number_types import COORDINATE_MAX

CHOSEN_COLOR = (80, 220, 80)
"""Blue, green, red."""
OTHER_COLOR = (200, 200, 200)
_DARK = (0, 0, 0)
_LINE_AT = 360
"""Picture height in pixels at which a thin line is one pixel wide."""
_TEXT_AT = 800.0
"""Picture height at which letters have the font's size, about 20 pixels."""
_FONT = cv2.FONT_HERSHEY_SIMPLEX

Image = NDArray[np.uint8]


def draw_boxes(
    image: Image, boxes: Sequence[tuple[int, float, float, float, float]], chosen: int | None
) -> None:
    """Draw boxes on a picture ``(height, width, 3)`` BGR: the chosen person's last, in its own color.

    A box is (object, left, top, right, bottom); right and bottom are exclusive.
    """
    line = max(1, round(image.shape[0] / _LINE_AT))
    for number, *box in sorted(boxes, key=lambda numbered: (numbered[0] == chosen, numbered[0])):
        width, color = (2 * line, CHOSEN_COLOR) if number == chosen else (line, OTHER_COLOR)
        left, top, right, bottom = (round(edge) for edge in np.clip(box, -COORDINATE_MAX, COORDINATE_MAX))
        cv2.rectangle(image, (left, top), (right - 1, bottom - 1), color, width)
        _number(image, (left, top), str(number), color)


def _number(image: Image, at: tuple[int, int], text: str, color: tuple[int, int, int]) -> None:
    """Draw a number on a filled label, above the box or, at the picture's edge, inside it."""
    scale, weight = max(0.35, image.shape[0] / _TEXT_AT), max(1, round(image.shape[0] / _TEXT_AT))
    (width, height), below = cv2.getTextSize(text, _FONT, scale, weight)
    left, top = max(0, at[0]), at[1] - height - below - 2
    top = top if top >= 0 else max(0, at[1])
    cv2.rectangle(image, (left, top), (left + width + 3, top + height + below + 1), color, cv2.FILLED)
    cv2.putText(image, text, (left + 2, top + height + 1), _FONT, scale, _DARK, weight, cv2.LINE_AA)
