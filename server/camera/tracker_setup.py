"""A camera's tracker, set up from the configuration and, for a recording, prepared by a prescan."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from bestview import to_ground
from server.camera.sources import FrameSource, Image
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
    source: FrameSource | None,
    solver: Callable[[], Solver],
    letterbox: Letterbox | None = None,
    *,
    prescan: bool = True,
    tracked_images: Callable[[Sequence[int]], Iterator[Image]] | None = None,
) -> Tracker:
    """Create the tracker of a name; with ``prescan``, one that needs it has scanned the recording.

    Images are scaled by ``letterbox``, if given. ``tracked_images`` returns the pictures of some frames, if
    those are not the source's.
    """
    track = config.track
    letterbox = letterbox or (None if source is None else Letterbox(source.size, source.size))
    settings = track.temporal if letterbox is None else _with_room_width(track.temporal, camera, letterbox)
    center = None if letterbox is None else (letterbox.site_size[0] / 2.0, letterbox.site_size[1] / 2.0)
    tracker = create_tracker(
        name, track.window, track.costs, solver, settings, config.site.fps, track.assist, center
    )
    if prescan and source is not None and letterbox is not None and isinstance(tracker, PrescanTracker):
        indices = config.detect.prescan_frames(config.site.fps)
        tracker.prepare(
            (letterbox.image(image) for image in source.prescan_images(indices))
            if tracked_images is None
            else tracked_images(indices)
        )
    return tracker


def _with_room_width(
    settings: TemporalSettings, camera: CameraSettings, letterbox: Letterbox
) -> TemporalSettings:
    """Set the room width from the homography, if its unit is known; letterbox bars are included."""
    per_meter = UNITS_PER_METER.get(camera.ground_unit or "")
    if camera.ground is None or per_meter is None:
        return settings
    width, height = letterbox.site_size
    ends = letterbox.site_to_camera(np.array([[0.0, height / 2.0], [width, height / 2.0]]))
    left, right = to_ground(np.array(camera.ground, dtype=np.float64), ends)
    width_m = float(np.hypot(*(right - left))) / per_meter
    return replace(settings, room_m=width_m) if np.isfinite(width_m) else settings
