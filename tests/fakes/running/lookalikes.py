"""A film of two who are dressed alike: they meet, one is behind the other for a moment, and they turn back.

Who sees the film may know it; a tracker, which has everybody go on as they went, takes each for the other
from then on. Afterwards they stand where they came from, so that it can be told at any time.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.faults.video.stamped_views import write_film
from fakes.running.stream_frames import FPS

MET = 80
"""The pulse in which they meet."""
FRAMES = 6000
"""Ten minutes of pulses, as long as any test may take: a busy machine is minutes late."""
_SIZE = 180, 320
_WIDE, _TALL, _TOP = 20, 60, 60
_FAR, _STEP = 100, 2
"""Pixels from where they meet to where they stand, and that they walk a frame."""
STAND = MET + _FAR // _STEP
"""The pulse from which they stand."""
_BEHIND = 6
"""Frames before and after, in which one hides the other."""
_GREY, _GREEN = 110, (60, 200, 60)


def camera(name: str, folder: Path) -> dict[str, Any]:
    """Write the film and what is found in it, of 320 x 180 pixels; give the camera that shows it."""
    film, found = folder / f"{name}.mp4", folder / f"{name}.txt"
    sides = [_sides(pulse) for pulse in range(FRAMES)]
    drawn = {side: _picture(side) for side in set(sides)}
    write_film([drawn[side] for side in sides], film, FPS)
    lines = [
        f"{pulse + 1},-1,{left},{_TOP},{_WIDE},{_TALL},1,-1,-1,-1"
        for pulse, both in enumerate(sides)
        for left in both[: 1 if abs(pulse - MET) < _BEHIND else 2]
    ]
    found.write_text("\n".join(lines), encoding="ascii")
    return {"id": name, "source": str(film), "detections": str(found)}


def _sides(pulse: int) -> tuple[int, int]:
    """Return the left sides of their boxes."""
    off = min(_STEP * abs(pulse - MET), _FAR)
    return (_SIZE[1] - _WIDE) // 2 - off, (_SIZE[1] - _WIDE) // 2 + off


def _picture(sides: tuple[int, int]) -> NDArray[np.uint8]:
    picture = np.full((*_SIZE, 3), _GREY, dtype=np.uint8)
    for left in sides:
        picture[_TOP : _TOP + _TALL, left : left + _WIDE] = _GREEN
    return picture
