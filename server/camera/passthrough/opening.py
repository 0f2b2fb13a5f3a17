"""Opens a camera for passthrough of its own video."""

from __future__ import annotations

from dataclasses import dataclass

from server.camera.audio import LiveAudioSource
from server.camera.passthrough.compatibility import OR_ENCODE, IncompatibleStreamError, required_format
from server.camera.passthrough.encoder import PassthroughSource
from server.camera.passthrough.recording_source import PassthroughRecording
from server.camera.passthrough.stream_source import PassthroughStream
from server.config.sections import CameraSettings
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.system.errors import UnavailableError, UserError


@dataclass(frozen=True, slots=True)
class PassthroughOpening:
    """The result of opening a camera for passthrough."""

    source: PassthroughSource | None
    """None: the camera's video must be encoded."""
    reason: str
    """Why it must be encoded; empty: passthrough was not requested."""


def open_passthrough(
    config: Config, camera: CameraSettings, listener: LiveAudioSource | None
) -> PassthroughOpening:
    """Open a camera for passthrough of its own video, where the configuration asks for that.

    Raises:
        UserError: it cannot be opened, or does not fit though the configuration demands it.
        UnavailableError: the same, of a network camera that may become available.
    """
    if camera.passthrough == "off":
        return PassthroughOpening(None, "")
    try:
        return PassthroughOpening(_open(config, camera, listener), "")
    except IncompatibleStreamError as error:
        if camera.passthrough == "pass":
            raise UserError(f"camera {camera.id}: passthrough: pass: {error}; {OR_ENCODE}") from error
        return PassthroughOpening(None, str(error))
    except UserError as error:
        is_stream = source_kind(camera.source) is SourceKind.STREAM
        raise (UnavailableError if is_stream else UserError)(f"camera {camera.id}: {error}") from error


def _open(config: Config, camera: CameraSettings, listener: LiveAudioSource | None) -> PassthroughSource:
    decodes = camera.substream is None  # otherwise people are tracked in that
    match source_kind(camera.source):
        case SourceKind.STREAM:
            return PassthroughStream(
                camera.source, camera.options, listener, required_format(config), decodes=decodes
            )
        case SourceKind.FILE:
            first = camera.first_pulse(config.site.fps)
            return PassthroughRecording(
                camera.source, first, camera.at_end, required_format(config), decodes=decodes
            )
        case _:
            raise IncompatibleStreamError("image files contain no video stream")
