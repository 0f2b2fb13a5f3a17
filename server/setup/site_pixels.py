"""Settings in pixels of the site's picture, which follow when its size changes.

Those in pixels of a camera's own picture, of a detector's working image or of a network's input stay: these
keep their size. So do defaults, which are meant for any size.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.media.letterbox import Letterbox
from server.setup.yaml_edit import plain_numbers
from server.system.errors import UserError
from tracking import CostSettings

Size = tuple[int, int]

_SAME = 1.0
"""Pixels by which two cameras' pictures may lie differently, since sizes are rounded."""
_DIGITS = 1
"""Decimals of corners, as where they are marked."""
_PER_PIXEL = ("displacement", "layout")
"""Costs per pixel."""


@dataclass(frozen=True, slots=True)
class PictureChange:
    """How a point of the site's picture moves: ``scale`` times its coordinates, plus ``offset``."""

    scale: float
    offset: tuple[float, float]

    def move(self, points: Any) -> NDArray[np.float64]:
        """Return where points (N, 2) are."""
        return np.asarray(points, dtype=np.float64) * self.scale + self.offset


def find_change(before: Size, after: Size, pictures: Collection[Size]) -> PictureChange | None:
    """Return how what cameras show moves if the site's picture changes its size; None: not alike in all.

    Args:
        before: width and height.
        after: width and height.
        pictures: sizes of all cameras' own pictures; needed only if the shape changes.
    """
    if has_same_shape(before, after):
        return _change(before, before, after)
    found = [_change(size, before, after) for size in pictures]
    corners = [(0, 0), before]
    if not found or any(np.abs(found[0].move(corners) - one.move(corners)).max() > _SAME for one in found):
        return None
    return found[0]


def moved_settings(
    config: Config, content: Mapping[str, Any], after: Size, pictures: Mapping[str, Size]
) -> dict[str, dict[str, Any]]:
    """Return the values that settings of a configuration get with another size of the site, by section.

    Args:
        config: the configuration with its present size.
        content: of its file: only what is written there changes.
        after: the new width and height.
        pictures: sizes of the cameras' own pictures by camera, as far as they are known.

    Raises:
        UserError: they cannot follow.
    """
    _check_scenes(config)
    areas = (content.get("detect") or {}).get("ignore") or []
    written = (content.get("track") or {}).get("costs") or {}
    costs = {name: written[name] for name in _pixel_costs(config.track.costs) if written.get(name)}
    if not areas and not costs:
        return {}
    names = ", ".join([*(["detect.ignore"] if areas else []), *(f"track.costs.{name}" for name in costs)])
    unknown = [camera for camera in config.camera_ids if camera not in pictures]
    if unknown and not has_same_shape(config.site.size, after):
        raise UserError(
            f"{names}: in pixels of the site's picture; how they move is not known without the picture of "
            f"camera {', '.join(unknown)}: keep its shape, or wait until the camera sends"
        )
    sizes = [pictures[camera] for camera in config.camera_ids if camera in pictures]
    change = find_change(config.site.size, after, sizes)
    if change is None:
        raise UserError(
            f"{names}: in pixels of the site's picture, in which not all cameras' pictures will "
            "lie alike: keep its shape, or remove this first (areas: to each camera's own ignore)"
        )
    moved: dict[str, dict[str, Any]] = {}
    if areas:
        moved["detect"] = {
            "ignore": [plain_numbers(change.move(area).round(_DIGITS).tolist()) for area in areas]
        }
    if costs:
        factors = {name: 1 / change.scale if name in _PER_PIXEL else change.scale for name in costs}
        scaled = {name: float(f"{value * factors[name]:.6g}") for name, value in costs.items()}
        moved["track"] = {"costs": scaled}
    return moved


def _pixel_costs(costs: CostSettings) -> tuple[str, ...]:
    """Return the settings of tracking in pixels, or per pixel."""
    in_unit = ("displacement", "gate") if costs.displacement_unit == "pixels" else ()
    return (*in_unit, "layout", "conflict_distance")


def _check_scenes(config: Config) -> None:
    """Check that no synthetic camera, whose own picture has the site's size, has settings in its pixels.

    Raises:
        UserError: one has.
    """
    marked = {zone.camera for zone in config.zones}
    for camera in config.cameras:
        has_pixels = camera.ignore or camera.ground is not None or camera.id in marked
        if has_pixels and source_kind(camera.source) is SourceKind.SCENE:
            raise UserError(
                f"camera {camera.id}: its scene is drawn in the site's size: remove its ignore, ground and "
                "zones, in pixels of its picture, first"
            )


def has_same_shape(before: Size, after: Size) -> bool:
    """Return whether two sizes have one shape, to the pixel."""
    _, _, width, height = Letterbox(before, after).content
    return max(after[0] - width, after[1] - height) <= 1


def _change(picture: Size, before: Size, after: Size) -> PictureChange:
    """Return how what a camera of some size shows moves."""
    old, new = Letterbox(picture, before), Letterbox(picture, after)
    left, top = new.camera_to_site(old.site_to_camera(np.zeros(2))).tolist()
    return PictureChange(new.scale / old.scale, (left, top))
