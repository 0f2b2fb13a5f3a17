"""Reload plan: what a changed configuration means for the running processes of a site."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from server.config.config_diff import changed_keys
from server.config.sections import LIVE_VIEW_SETTINGS, CameraSettings, TrackSettings
from server.config.site_config import Config

_LIVE = tuple(f"view.{name}" for name in LIVE_VIEW_SETTINGS)
"""Settings that the best view applies at the next GOP."""
_CAMERA_KEYS = (
    "source",
    "substream",
    "password",
    "offset_s",
    "at_end",
    "passthrough",
    "options",
    "ignore",
    "detections",
)
"""Settings that only the camera's own process uses."""
_TRACK = tuple(name for name in TrackSettings.model_fields if name not in {"backlog_s", "joint"})
_SHARED_KEYS = ("detect", *(f"track.{name}" for name in _TRACK))
"""Settings that only camera processes use."""
_EPOCHS = ("track.window.length_s", "track.window.stride_s", "track.window.min_frames")
"""Of these, settings by which the best view aligns tracking windows: they need a restart of the site."""
_BY_LAG = ("tracker", "temporal")
"""Of these, settings that may change the lag of final frames, and then need a restart of the site."""
_GATEWAY = (
    "rtsp.host",
    "rtsp.port",
    "rtsp.clients_max",
    "rtsp.udp",
    "rtsp.tls",
    "rtsp.service",
    "rtsp.certificate",
    "rtsp.python",
)
"""Settings that only the RTSP gateway uses."""
_LIVE_SECTIONS = ("zones", "rules")
"""Sections that the best view applies as a whole; they name cameras, so new ones need a restart first."""
_INTEGRATIONS = ("webhooks", "mqtt")
_TIME_ZONE = "site.time_zone"
_BY_JOINT = ("tracker", "assist")
"""Of these, settings that may change whether people are tracked jointly, and then need one, too."""
_BEST_VIEW_SECTIONS = ("view", "http", "access", "record", "sites")


@dataclass(frozen=True, slots=True)
class ReloadPlan:
    """The effects of a changed configuration.

    Attributes:
        now: the configuration to activate: the old one with all settings that can change while running.
        live: settings that the best view applies without interrupting streams.
        cameras: cameras whose processes have to restart.
        gateway: settings of the RTSP gateway, which restarts.
        best_view: settings that wait for a restart of the best view, which ends streams.
        site: settings that wait for a restart of all processes.
    """

    now: Config
    live: tuple[str, ...] = ()
    cameras: tuple[str, ...] = ()
    gateway: tuple[str, ...] = ()
    best_view: tuple[str, ...] = ()
    site: tuple[str, ...] = ()

    @property
    def line(self) -> str:
        """The plan in one log line."""
        parts = {
            "in force now": self.live,
            "these cameras restart": self.cameras,
            "the RTSP gateway restarts": self.gateway,
            "waits for a restart of the best view, which ends streams": self.best_view,
            "waits for a restart of all processes": self.site,
        }
        effects = "; ".join(f"{effect}: {', '.join(names)}" for effect, names in parts.items() if names)
        return f"configuration reloaded: {effects or 'no changes'}"


def plan_reload(running: Config, wanted: Config) -> ReloadPlan:
    """Plan what a changed configuration means for a running site."""
    keys = changed_keys(running, wanted)
    view = running.view.model_copy(update={name: getattr(wanted.view, name) for name in LIVE_VIEW_SETTINGS})
    sections = (*_LIVE_SECTIONS, *_INTEGRATIONS) if running.camera_ids == wanted.camera_ids else ()
    live = _of(keys, (*_LIVE, *sections, _TIME_ZONE))
    try:
        running.check_lookahead(view)
    except ValueError:  # the settings that allow a shorter one wait for a restart
        view = view.model_copy(update={"lookahead_s": running.view.lookahead_s})
        live = tuple(key for key in live if key != "view.lookahead_s")
    unchanged = _deferred_track_settings(running, wanted, keys)
    shared = tuple(
        key for key in _of(keys, _SHARED_KEYS) if not _of((key,), [f"track.{name}" for name in unchanged])
    )
    # Pass-through depends on the site's codec: if that changes, it needs a restart, too.
    camera_keys = tuple(key for key in _CAMERA_KEYS if not (key == "passthrough" and "encode.codec" in keys))
    camera_changes = {
        camera: _of(keys, [f"cameras.{camera}.{name}" for name in camera_keys])
        for camera in running.camera_ids
    }
    # Cameras measure sharpness only if it has a weight.
    sharpness_toggled = (running.view.quality.sharpness > 0) != (view.quality.sharpness > 0)
    restarted = tuple(
        camera for camera in running.camera_ids if shared or sharpness_toggled or camera_changes[camera]
    )
    gateway = _of(keys, _GATEWAY)
    applied = {*live, *shared, *gateway, *(key for names in camera_changes.values() for key in names)}
    waiting = tuple(key for key in keys if key not in applied)
    best_view = _of(waiting, _BEST_VIEW_SECTIONS)
    now = running.model_copy(
        update={
            "view": view,
            "detect": wanted.detect,
            "rtsp": wanted.rtsp.model_copy(update={"enabled": running.rtsp.enabled}),
            "track": _track(running, wanted, unchanged),
            **{name: getattr(wanted, name) for name in sections},
            "site": running.site.model_copy(update={"time_zone": wanted.site.time_zone}),
            "cameras": [_camera(running, wanted, camera, camera_keys) for camera in running.camera_ids],
        }
    )
    site = tuple(key for key in waiting if key not in best_view)
    return ReloadPlan(now, live, restarted, gateway, best_view, site)


def _of(keys: Sequence[str], sections: Sequence[str]) -> tuple[str, ...]:
    """Return the keys that are in one of the sections."""
    return tuple(key for key in keys if any(f"{key}.".startswith(f"{section}.") for section in sections))


def _deferred_track_settings(running: Config, wanted: Config, keys: Sequence[str]) -> tuple[str, ...]:
    """Return settings of `track` that need a restart.

    They change when windows end, when frames are final, or whether people are tracked jointly.
    """
    fps = running.site.fps
    changed = running.track.model_copy(update={name: getattr(wanted.track, name) for name in _BY_LAG})
    late = _BY_LAG if changed.final_lag(fps) != running.track.final_lag(fps) else ()
    joint_cameras = running.model_copy(update={"track": wanted.track}).joint_cameras
    joint = _BY_JOINT if joint_cameras != running.joint_cameras else ()
    window = ("window",) if any(key in _EPOCHS for key in keys) else ()
    return tuple(dict.fromkeys((*late, *joint, *window)))


def _track(running: Config, wanted: Config, unchanged: Sequence[str]) -> TrackSettings:
    """Return the new `track` section, with old values of the settings that need a restart."""
    names = [name for name in _TRACK if name not in unchanged]
    return running.track.model_copy(update={name: getattr(wanted.track, name) for name in names})


def _camera(running: Config, wanted: Config, camera_id: str, names: Sequence[str]) -> CameraSettings:
    """Return a camera's section with the new values of the settings that only its own process uses."""
    before = running.camera(camera_id)
    if running.camera_ids != wanted.camera_ids:
        return before
    after = wanted.camera(camera_id)
    return before.model_copy(update={name: getattr(after, name) for name in names})
