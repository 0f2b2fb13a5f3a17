"""A camera's tracker, set up from the configuration, and ready for the first frame of a recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bestview import to_ground
from server.camera.sources import PictureSource
from server.config.ground_unit import UNITS_PER_METER
from server.config.sections import CameraSettings
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from tracking import Solver
from tracking.baselines.temporal_consistency import TemporalSettings
from tracking.registry import PrescanTracker, Tracker, create_tracker


def set_up_tracker(
    config: Config,
    name: str,
    camera: CameraSettings,
    source: PictureSource | None,
    solver: Callable[[], Solver],
    fit: Letterbox | None = None,
    *,
    ready: bool = True,
) -> Tracker:
    """Return the tracker of that name; for a recording, what has to learn the room has done so.

    It looks at the source's pictures as ``fit`` makes them, or at these themselves; not ``ready``: at none
    ahead.
    """
    track = config.track
    seen = fit or (None if source is None else Letterbox(source.size, source.size))
    settings = track.temporal if seen is None else _measured(track.temporal, camera, seen)
    tracker = create_tracker(
        name, track.window, track.costs, solver, settings, config.site.fps, assist=track.assist
    )
    if ready and source is not None and seen is not None and isinstance(tracker, PrescanTracker):
        places = range(0, config.detect.prescan_frames, config.detect.prescan_every)
        tracker.prepare(seen.image(image) for image in source.ahead(places))
    return tracker


def _measured(settings: TemporalSettings, camera: CameraSettings, fit: Letterbox) -> TemporalSettings:
    """Take how much floor a picture is wide, black columns and all, from the ground where it is in metres."""
    per_metre = UNITS_PER_METER.get(camera.ground_unit or "")
    if camera.ground is None or per_metre is None:
        return settings
    width, height = fit.size
    ends = fit.to_own(np.array([[0.0, height / 2.0], [width, height / 2.0]]))
    left, right = to_ground(np.array(camera.ground, dtype=np.float64), ends)
    across = float(np.hypot(*(right - left))) / per_metre
    return replace(settings, room_m=across) if np.isfinite(across) else settings
