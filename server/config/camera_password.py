"""Camera passwords from separate files, so that the configuration that others read has none."""

from __future__ import annotations

from urllib.parse import quote

from server.config.sections import CameraSettings
from server.config.site_config import Config
from server.system.errors import UserError, reason_of

PLACEHOLDER = "{password}"
"""Replaced by the password in a camera's source and substream."""


def fill_in_password(config: Config, camera_id: str) -> Config:
    """Fill in one camera's password; only that camera's process needs the file.

    Raises:
        UserError: the file cannot be read, or is not one line of text.
    """
    camera = config.camera(camera_id)
    if camera.password is None:
        return config
    password = _quoted(camera)
    substream = None if camera.substream is None else camera.substream.replace(PLACEHOLDER, password)
    source = camera.source.replace(PLACEHOLDER, password)
    filled = camera.model_copy(update={"source": source, "substream": substream})
    cameras = [filled if other.id == camera_id else other for other in config.cameras]
    return config.model_copy(update={"cameras": cameras})


def _quoted(camera: CameraSettings) -> str:
    """Return the password, percent-encoded for a URL."""
    assert camera.password is not None  # noqa: S101 — the caller has checked
    where = f"cameras.{camera.id}.password: the file"  # not its name: some enter the password there
    try:
        text = camera.password.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = reason_of(error, "it is not text")
        raise UserError(f"{where} cannot be read: {reason}") from None
    password = text.removesuffix("\n").removesuffix("\r")
    if not password or not password.isprintable():
        raise UserError(f"{where} must be one line, the password")
    return quote(password, safe="")
