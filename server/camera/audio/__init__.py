"""The site's audio, from a camera or a file: encoded frames on the pulse clock."""

from __future__ import annotations

from server.camera.audio.frames import EncodedAudioFrame, consecutive_runs
from server.camera.audio.live_source import LiveAudioSource
from server.camera.audio.recorded_source import RecordedAudioSource
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.system.address_redaction import redact_to_host
from server.system.errors import UserError

__all__ = [
    "EncodedAudioFrame",
    "LiveAudioSource",
    "RecordedAudioSource",
    "consecutive_runs",
    "open_site_audio",
]


def open_site_audio(config: Config, camera_id: str) -> RecordedAudioSource | LiveAudioSource | None:
    """Open the site's one audio source if this camera's process sends it; None: it does not.

    Raises:
        UserError: it cannot be opened.
    """
    settings, fps = config.sound, config.site.fps
    if settings.source is None or config.audio_sender != camera_id:
        return None
    path, offset_s, at_end = settings.source, settings.offset_s, settings.at_end
    if settings.source in config.camera_ids:
        camera = config.camera(camera_id)
        path, offset_s, at_end = camera.source, camera.offset_s, camera.at_end
        if source_kind(path) is SourceKind.STREAM:
            return LiveAudioSource(settings, fps, config.gop / fps)
        if source_kind(path) is not SourceKind.FILE:
            raise UserError(
                f"sound: camera {camera_id} has no audio: {redact_to_host(path)}; name another, or a file"
            )
    try:
        return RecordedAudioSource(path, settings, fps, round(offset_s * fps), at_end)
    except UserError as error:
        raise UserError(f"sound: {error}") from error
