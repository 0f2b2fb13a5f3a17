"""A camera's password from a file of its own, so that it is in no configuration that others read."""

from __future__ import annotations

from urllib.parse import quote

from server.config.sections import CameraSettings
from server.config.site_config import Config
from server.system.errors import UserError

PLACE = "{password}"
"""Where the password goes in an address."""


def fill_in_password(config: Config, camera_id: str) -> Config:
    """Fill in one camera's password; only that camera's process needs the file.

    Raises:
        UserError: the file cannot be read, or is no line of text.
    """
    camera = config.camera(camera_id)
    if camera.password is None:
        return config
    filled = camera.model_copy(update={"source": camera.source.replace(PLACE, _quoted(camera))})
    cameras = [filled if it.id == camera_id else it for it in config.cameras]
    return config.model_copy(update={"cameras": cameras})


def _quoted(camera: CameraSettings) -> str:
    """Read the password, percent-encoded for an address."""
    assert camera.password is not None  # noqa: S101 — the caller has checked
    where = f"cameras.{camera.id}.password: the file"  # not by its name: some write the password there
    try:
        text = camera.password.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not text"
        raise UserError(f"{where} cannot be read: {reason}") from None
    password = text.removesuffix("\n").removesuffix("\r")
    if not password or not password.isprintable():
        raise UserError(f"{where} must be one line, the password")
    return quote(password, safe="")
