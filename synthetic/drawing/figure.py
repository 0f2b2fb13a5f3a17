"""Drawn people: shaded capsules, nearest last, antialiased by supersampling."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats, PinholeCamera
from synthetic.drawing.limbs import CapsuleBody

_ARC = 7  # corners of a capsule's end
_SHIFT = 4  # fractional bits of cv2's coordinates
_TALL = 280  # drawn pixels from which a figure is supersampled by 2 only, instead of 4
_SUN = np.array([-0.55, -0.45, 0.70])  # towards the light
# A limb is drawn several times: full and dark, then narrower, brighter and shifted towards the light.
_TONES = np.array([0.72, 0.85, 0.96, 1.04])
_GIRTHS = np.array([1.0, 0.85, 0.64, 0.38])
_OFFSETS = np.array([0.0, 0.12, 0.25, 0.40])

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Figure:
    """A drawn object: a patch whose top left corner is the image's pixel ``(left, top)``."""

    left: int
    top: int
    patch: Bytes  # (h, w, 4) blue, green, red times alpha, and alpha


@dataclass(frozen=True, slots=True)
class ClipRegion:
    """The part of a figure's patch within the image."""

    area: tuple[slice, slice]  # of the image
    patch: tuple[slice, slice]  # of the patch


def clip_to_image(figure: Figure, view: PinholeCamera) -> ClipRegion | None:
    """Clip a figure to the image; return None if nothing is left."""
    height, width = figure.patch.shape[:2]
    left, top = max(figure.left, 0), max(figure.top, 0)
    right, bottom = min(figure.left + width, view.width), min(figure.top + height, view.height)
    if left >= right or top >= bottom:
        return None
    return ClipRegion(
        (slice(top, bottom), slice(left, right)),
        (slice(top - figure.top, bottom - figure.top), slice(left - figure.left, right - figure.left)),
    )


def draw_figure(view: PinholeCamera, body: CapsuleBody, joints: Floats, light: float) -> Figure | None:
    """Draw a body by its joints ``(J, 3)`` in meters; `light` scales its colors.

    The patch extends beyond the image's edge if the body does. None if the body is behind the camera.
    """
    pixels, depth = view.project(joints)
    if depth.min() < 0.3:  # noqa: PLR2004 — meters: inside the lens
        return None
    scale = view.focal / depth
    first, last = pixels[body.starts], pixels[body.ends]
    radii = np.stack([body.radii[:, 0] * scale[body.starts], body.radii[:, 1] * scale[body.ends]], axis=1)
    low = np.minimum(first - radii[:, :1], last - radii[:, 1:]).min(axis=0)
    high = np.maximum(first + radii[:, :1], last + radii[:, 1:]).max(axis=0)
    left, top = (int(np.floor(value)) - 1 for value in low)
    width, height = int(np.ceil(high[0])) + 1 - left, int(np.ceil(high[1])) + 1 - top
    fine = 2 if height * 2 >= _TALL else 4
    corner = np.array([left, top])
    outlines = _outlines(
        (first - corner) * fine - 0.5, (last - corner) * fine - 0.5, radii * fine, _sunward(view)
    )
    middle = (depth[body.starts] + depth[body.ends]) / 2
    away = np.array([middle[limbs].mean() for limbs in body.groups]) - body.depth_offset
    canvas = np.zeros((height * fine, width * fine, 4), dtype=np.uint8)
    colors = np.clip(body.colors[:, None, ::-1] * _TONES[:, None] * (255 * light), 0, 255)
    inks = np.concatenate([colors, np.full((*colors.shape[:2], 1), 255.0)], axis=2).tolist()
    for group in np.argsort(-away, kind="stable").tolist():
        limbs = body.groups[group].tolist()
        for tone in range(len(_TONES)):
            for limb in limbs:
                if tone < body.tones[limb]:
                    cv2.fillConvexPoly(canvas, outlines[limb, tone], inks[limb][tone], cv2.LINE_8, _SHIFT)
    patch = cv2.resize(canvas, (width, height), interpolation=cv2.INTER_AREA)
    return Figure(left, top, np.asarray(patch, dtype=np.uint8))


def _sunward(view: PinholeCamera) -> Floats:
    """Return the direction to the light in the image."""
    across = view.axes[:2] @ _SUN
    unit: Floats = across / np.linalg.norm(across)
    return unit


def _outlines(first: Floats, last: Floats, radii: Floats, sunward: Floats) -> NDArray[np.int32]:
    """Return the outlines ``(L, T, 2 * _ARC, 2)`` of capsules in every tone, in cv2's fixed point."""
    span = last - first
    length = np.hypot(span[:, 0], span[:, 1])
    angle = np.arctan2(span[:, 1], span[:, 0])
    # If one end contains the other, the outline is that end's circle.
    tangent = np.arccos(np.clip((radii[:, 0] - radii[:, 1]) / np.maximum(length, 1e-6), -1, 1))
    turn = np.linspace(0, 1, _ARC)
    back = (angle + tangent)[:, None] + (2 * (np.pi - tangent))[:, None] * turn
    front = (angle - tangent)[:, None] + (2 * tangent)[:, None] * turn
    circles = [np.stack([np.cos(arc), np.sin(arc)], axis=-1) for arc in (back, front)]
    ends = []
    for center, radius, circle in zip((first, last), radii.T, circles, strict=True):
        middle = center[:, None] + radius[:, None, None] * _OFFSETS[:, None] * sunward
        rim = radius[:, None, None, None] * _GIRTHS[:, None, None] * circle[:, None]
        ends.append(middle[:, :, None] + rim)
    outline = np.concatenate(ends, axis=2)
    fixed: NDArray[np.int32] = np.rint(outline * (1 << _SHIFT)).astype(np.int32)
    return fixed


def paste(image: Bytes, view: PinholeCamera, figure: Figure, visible_mask: Bytes | None = None) -> None:
    """Blend a figure over an image ``(H, W, 3)`` in place; the mask is its clipped part's visible share."""
    part = clip_to_image(figure, view)
    if part is None:
        return
    patch = figure.patch[part.patch]
    if visible_mask is not None:
        shown = cv2.multiply(patch, cv2.merge([visible_mask] * 4), scale=1 / 255)
        patch = np.asarray(shown, dtype=np.uint8)
    through = cv2.cvtColor(255 - patch[:, :, 3], cv2.COLOR_GRAY2BGR)
    behind = cv2.multiply(image[part.area], through, scale=1 / 255)
    image[part.area] = cv2.add(behind, cv2.cvtColor(patch, cv2.COLOR_BGRA2BGR))
