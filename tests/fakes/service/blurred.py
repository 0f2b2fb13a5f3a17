"""Comparison of a shown picture with what a camera has sent: who is hidden in it, and who is not."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from fakes.service.drawn_site import CAMERAS, GOP, DrawnSite, Image, decoded


def hidden_parts(room: DrawnSite, camera: str, pulse: int, number: int | None) -> tuple[Any, Any, Any]:
    """Return masks of a frame: other people's bodies, all that may be hidden, and one person's body."""
    first = pulse // GOP * GOP
    decision, place = room.decisions[first], pulse % GOP
    shape = next(decoded(0, 1)).shape[:2]
    bodies, hidden, person = (np.zeros(shape, dtype=bool) for _ in range(3))
    regions = room.service.decision_state.occupied(camera, first)[place]
    assert regions is not None
    for mask, boxes in ((bodies, decision.boxes[camera][place]), (hidden, regions)):
        for box_number, *box in boxes:
            left, top, right, bottom = (max(0, round(edge)) for edge in box)
            if box_number != number:
                mask[top : bottom + 1, left : right + 1] = True
            elif mask is bodies:
                person[top:bottom, left:right] = True
    return bodies, hidden, person


def assert_hides_others(room: DrawnSite, image: Image, camera: str, pulse: int, number: int | None) -> None:
    """Assert that other people carry no detail, and that all but them is as the camera sent it."""
    truth = list(decoded(CAMERAS.index(camera), pulse + 1))[pulse]
    bodies, hidden, person = hidden_parts(room, camera, pulse, number)
    changed = np.abs(image.astype(np.int16) - truth).mean(axis=2)
    assert bodies.sum() > 50, "somebody else is in the picture"
    assert edges_in(image, bodies) < 0.4 * edges_in(truth, bodies)
    near = cv2.dilate(hidden.astype(np.uint8), np.ones((9, 9))) > 0  # encoding spreads an edge
    assert changed[~near].mean() < 8
    if number is not None:
        assert (person & ~near).sum() > 20
        assert changed[person & ~near].mean() < 12


def edges_in(image: Image, mask: Any) -> float:
    """Return how much neighboring pixels differ inside a mask."""
    gray = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)
    return float(np.abs(cv2.Laplacian(gray, cv2.CV_32F))[mask].mean())


def shown_camera(room: DrawnSite, pulse: int, number: int) -> str:
    return room.decisions[pulse // GOP * GOP].choices[number]
