"""What is set in pixels of a camera's own picture, which follows when another address sends another size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from server.config.sections.rules import PICTURE_MARGIN
from server.service.calibration.points_file import parse_points
from server.setup.site_pixels import Size, has_same_shape
from server.setup.yaml_edit import plain_numbers
from server.system.errors import UserError

_DIGITS = 1
"""Decimals of corners, as where they are marked."""


@dataclass(frozen=True, slots=True)
class CameraPixels:
    """A camera's part of a configuration and of its ground file.

    Attributes:
        entry: the camera, as in the file.
        zones: all zones, as in the file.
        ground: the content of the ground file; empty: there is none.
        note: what was scaled, or must be redone, in a line for the operator; empty: nothing.
    """

    entry: Mapping[str, Any]
    zones: Sequence[Mapping[str, Any]] = ()
    ground: Mapping[str, Any] = field(default_factory=dict)
    note: str = ""


def follow_size(pixels: CameraPixels, before: Size | None, after: Size) -> CameraPixels:
    """Return what is set in pixels for another size of the camera's picture, if its shape stays; and a note.

    Of another shape it may show another part of the scene: then everything stays, and is to be redone.

    Args:
        pixels: what is set.
        before: width and height of the picture that it is set for; None: not known.
        after: the new width and height.
    """
    camera = str(pixels.entry.get("id"))
    parts = _parts(pixels, camera)
    if not parts or before == after:
        return pixels
    names = f"{', '.join(parts[:-1])} and {parts[-1]}" if len(parts) > 1 else parts[0]
    if before is None:
        return replace(pixels, note=f"the size of its earlier picture is not known: check its {names}")
    sizes = f"{before[0]}x{before[1]} to {after[0]}x{after[1]}"
    if not has_same_shape(before, after):
        return replace(pixels, note=f"its picture's shape changes from {sizes}: redo its {names}")
    factors = np.array(after, dtype=np.float64) / before
    return CameraPixels(
        _scaled(pixels.entry, factors),
        [_scaled(zone, factors) if zone.get("camera") == camera else zone for zone in pixels.zones],
        _scaled_ground(pixels.ground, camera, factors),
        f"scaled from {sizes}: its {names}",
    )


def _parts(pixels: CameraPixels, camera: str) -> list[str]:
    """Return what is in pixels of a camera's picture, by name."""
    homographies, points = pixels.ground.get("homography") or {}, pixels.ground.get("points") or {}
    is_calibrated = pixels.entry.get("ground") is not None or camera in homographies or camera in points
    return [
        *(["ignored areas"] if pixels.entry.get("ignore") else []),
        *(["calibration"] if is_calibrated else []),
        *(f"zone {zone['id']}" for zone in pixels.zones if zone.get("camera") == camera),
    ]


def _scaled(entry: Mapping[str, Any], factors: NDArray[np.float64]) -> dict[str, Any]:
    """Return a camera or a zone with its corners, homography and margin scaled."""
    changed = dict(entry)
    for key in ("area", "line", "inner"):
        if entry.get(key) is not None:
            changed[key] = _moved(entry[key], factors)
    if entry.get("ignore"):
        changed["ignore"] = [_moved(area, factors) for area in entry["ignore"]]
    if "camera" in entry:  # a zone, whose margin is a default unless it is written
        margin = PICTURE_MARGIN if entry.get("margin") is None else float(entry["margin"])
        changed["margin"] = plain_numbers(round(float(margin * factors.mean()), _DIGITS))
    if entry.get("ground") is not None:
        changed["ground"] = _homography(entry["ground"], factors)
    return changed


def _scaled_ground(ground: Mapping[str, Any], camera: str, factors: NDArray[np.float64]) -> dict[str, Any]:
    changed = dict(ground)
    if camera in (homographies := ground.get("homography") or {}):
        changed["homography"] = {**homographies, camera: _homography(homographies[camera], factors)}
    if camera in (points := ground.get("points") or {}) and _is_readable(points[camera]):
        moved = [{**pair, "image": _moved(pair["image"], factors)} for pair in points[camera]]
        changed["points"] = {**points, camera: moved}
    return changed


def _moved(points: Any, factors: NDArray[np.float64]) -> Any:
    return plain_numbers((np.asarray(points, dtype=np.float64) * factors).round(_DIGITS).tolist())


def _homography(matrix: Any, factors: NDArray[np.float64]) -> Any:
    return (np.asarray(matrix, dtype=np.float64) / (*factors, 1.0)).tolist()


def _is_readable(pairs: Any) -> bool:
    try:
        parse_points({"cameras": {"camera": pairs}}, "points")
    except UserError:
        return False
    return True
