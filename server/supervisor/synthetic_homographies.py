"""Ground homographies of synthetic scenes, whose cameras need no calibration."""

from __future__ import annotations

from server.config.sections import CameraSettings, SiteSettings
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind


def add_synthetic_homographies(config: Config) -> Config:
    """Return the configuration with homographies for synthetic cameras that have none configured.

    Raises:
        UserError: there is no such scene.
    """
    return config.model_copy(
        update={"cameras": [_calibrated(camera, config.site) for camera in config.cameras]}
    )


def add_joint_homographies(config: Config) -> Config:
    """Return the configuration with them where people are tracked jointly: then every process needs them.

    Raises:
        UserError: there is no such scene.
    """
    return add_synthetic_homographies(config) if config.track.is_joint else config


def _calibrated(camera: CameraSettings, site: SiteSettings) -> CameraSettings:
    if camera.ground is not None or source_kind(camera.source) is not SourceKind.SCENE:
        return camera
    from server.camera.sources.synthetic import SyntheticSource  # noqa: PLC0415 — only sites with scenes need it

    return camera.model_copy(update={"ground": SyntheticSource(camera.source, site).ground})
