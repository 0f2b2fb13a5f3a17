"""The soft shadow of a person on the floor."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, PinholeCamera
from synthetic.drawing.skeleton import Joint

Bytes = NDArray[np.uint8]

_COARSE = 4  # shadows are soft, so they are drawn at a quarter of the size
_SLANT = np.array([0.42, 0.34])  # meters on the floor per meter of height, away from the windows
_BODY = 54  # darkness, 0..255
_FEET = 112
_NEAREST = 0.5  # meters; nearer shadows are not drawn
_SHIFT = 4  # fractional bits of cv2's coordinates
_PARTS = (
    (Joint.ANKLE_L, Joint.KNEE_L, 0.07),
    (Joint.ANKLE_R, Joint.KNEE_R, 0.07),
    (Joint.KNEE_L, Joint.HIP_L, 0.09),
    (Joint.KNEE_R, Joint.HIP_R, 0.09),
    (Joint.BELLY, Joint.CHEST, 0.19),
    (Joint.HEAD, Joint.HEAD, 0.11),
)


def cast_shadow(image: Bytes, floor: Bytes, view: PinholeCamera, joints: Floats) -> None:
    """Darken an image ``(H, W, 3)`` in place where a body's shadow falls on bare floor ``(H, W)``."""
    ground = joints.copy()
    ground[:, :2] += joints[:, 2:] * _SLANT
    ground[:, 2] = 0.0
    points, depth = view.project(ground)
    if depth.min() < _NEAREST:
        return
    pixels_per_meter = view.focal / depth
    margin = 0.5 * float(pixels_per_meter.max())
    limits = (view.width, view.height)
    low = np.clip(points.min(axis=0) - margin, 0, limits).astype(int) // _COARSE * _COARSE
    high = np.clip(points.max(axis=0) + margin, 0, limits).astype(int)
    if (high - low).min() < _COARSE:
        return
    width, height = (high - low).tolist()
    size = ((height + _COARSE - 1) // _COARSE, (width + _COARSE - 1) // _COARSE)
    local, scale = (points - low) / _COARSE, pixels_per_meter / _COARSE
    dark = np.maximum(
        _body_shadow(size, local, scale), _contact(size, local, scale, round_=view.looks_straight_down)
    )
    full = cv2.resize(dark, None, fx=_COARSE, fy=_COARSE, interpolation=cv2.INTER_LINEAR)[:height, :width]
    area = (slice(low[1], high[1]), slice(low[0], high[0]))
    kept = cv2.cvtColor(255 - cv2.multiply(full, floor[area], scale=1 / 255), cv2.COLOR_GRAY2BGR)
    image[area] = cv2.multiply(image[area], kept, scale=1 / 255)


def _body_shadow(size: tuple[int, int], points: Floats, scale: Floats) -> Bytes:
    dark = np.zeros(size, dtype=np.uint8)
    ends = np.rint(points * (1 << _SHIFT)).astype(int)
    for start, end, width in _PARTS:
        thick = max(int(1.7 * width * scale[start]), 1)
        cv2.line(dark, ends[start].tolist(), ends[end].tolist(), (_BODY,), thick, cv2.LINE_AA, _SHIFT)
    soft = cv2.GaussianBlur(dark, (0, 0), max(0.075 * float(scale[Joint.ANKLE_L]), 0.6))
    return np.asarray(soft, dtype=np.uint8)


def _contact(size: tuple[int, int], points: Floats, scale: Floats, *, round_: bool) -> Bytes:
    """Draw the small dark contact shadows under the feet.

    They are `round_` if seen from straight above, otherwise flat.
    """
    dark = np.zeros(size, dtype=np.uint8)
    spread = float(scale[Joint.ANKLE_L])
    axes = (int(0.13 * spread * (1 << _SHIFT)), int((0.13 if round_ else 0.055) * spread * (1 << _SHIFT)))
    for ankle, toe in ((Joint.ANKLE_L, Joint.TOE_L), (Joint.ANKLE_R, Joint.TOE_R)):
        x, y = ((points[ankle] + points[toe]) / 2 * (1 << _SHIFT)).astype(int).tolist()
        cv2.ellipse(dark, (x, y), axes, 0, 0, 360, (_FEET,), -1, cv2.LINE_AA, _SHIFT)
    soft = cv2.GaussianBlur(dark, (0, 0), max(0.045 * spread, 0.5))
    return np.asarray(soft, dtype=np.uint8)
