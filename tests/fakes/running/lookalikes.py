"""A film of two people in the same clothes who meet, occlude each other briefly, and turn back.

A tracker, which expects people to keep walking, exchanges their ids. Afterwards they stand at their starting
points, so that the exchange can be corrected at any time.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.faults.video.stamped_views import write_film
from fakes.running.stream_frames import FPS

MEETING = 80
"""The pulse at which the two people meet."""
FRAMES = 6000
"""Ten minutes, the longest that a test may take."""
_SIZE = 180, 320
_WIDTH, _HEIGHT, _TOP = 20, 60, 60
_FAR, _STEP = 100, 2
"""Pixels from the meeting point to where they stand, and per frame."""
STANDING = MEETING + _FAR // _STEP
"""The pulse from which they stand still."""
_OCCLUDED = 3
"""Frames before and after the meeting in which one occludes the other."""
_GRAY, _GREEN = 110, (60, 200, 60)


def write_camera(name: str, folder: Path) -> dict[str, Any]:
    """Write the film, 320x180 pixels, and its detections; return the camera's configuration."""
    film, detections = folder / f"{name}.mp4", folder / f"{name}.txt"
    sides = [_sides(pulse) for pulse in range(FRAMES)]
    drawn = {side: _picture(side) for side in set(sides)}
    write_film([drawn[side] for side in sides], film, FPS)
    lines = [
        f"{pulse + 1},-1,{left},{_TOP},{_WIDTH},{_HEIGHT},1,-1,-1,-1"
        for pulse, both_edges in enumerate(sides)
        for left in both_edges[: 1 if abs(pulse - MEETING) < _OCCLUDED else 2]
    ]
    detections.write_text("\n".join(lines), encoding="ascii")
    return {"id": name, "source": str(film), "detections": str(detections)}


def _sides(pulse: int) -> tuple[int, int]:
    """Return the left edges of the two boxes."""
    distance = min(_STEP * abs(pulse - MEETING), _FAR)
    return (_SIZE[1] - _WIDTH) // 2 - distance, (_SIZE[1] - _WIDTH) // 2 + distance


def _picture(sides: tuple[int, int]) -> NDArray[np.uint8]:
    picture = np.full((*_SIZE, 3), _GRAY, dtype=np.uint8)
    for left in sides:
        picture[_TOP : _TOP + _HEIGHT, left : left + _WIDTH] = _GREEN
    return picture
