"""Homographies of cameras of a synthetic scene, which needs no calibration."""

from __future__ import annotations

from server.config.sections import CameraSettings, SiteSettings
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind


def add_scene_ground(config: Config) -> Config:
    """Return the configuration with the floor of every camera of a synthetic scene that has none of its own.

    Raises:
        UserError: there is no such scene.
    """
    return config.model_copy(update={"cameras": [_calibrated(it, config.site) for it in config.cameras]})


def _calibrated(camera: CameraSettings, site: SiteSettings) -> CameraSettings:
    if camera.ground is not None or source_kind(camera.source) is not SourceKind.SCENE:
        return camera
    from server.camera.sources.synthetic import SyntheticSource  # noqa: PLC0415 — it draws, and other sites need not load it

    return camera.model_copy(update={"ground": SyntheticSource(camera.source, site).ground})
