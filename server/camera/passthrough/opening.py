"""Opening a camera whose own H.264 is to be passed on."""

from __future__ import annotations

from dataclasses import dataclass

from server.camera.audio import LiveSound
from server.camera.passthrough.compatibility import MisfitError, wanted_by
from server.camera.passthrough.encoder import OwnSource
from server.camera.passthrough.recording_source import OwnRecording
from server.camera.passthrough.stream_source import OwnStream
from server.config.sections import CameraSettings
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.system.errors import UnavailableError, UserError


@dataclass(frozen=True, slots=True)
class Own:
    """What came of it."""

    source: OwnSource | None
    """None: the camera's pictures are to be encoded."""
    why: str
    """Why so; empty where nothing was asked for."""


def open_own(config: Config, camera: CameraSettings, listener: LiveSound | None) -> Own:
    """Open a camera's own H.264, if that is wished.

    Raises:
        UserError: it cannot be opened, or must fit and does not; the text says which camera and why.
        UnavailableError: the same, of a network camera that may yet come.
    """
    if camera.h264 == "encode":
        return Own(None, "")
    try:
        return Own(_opened(config, camera, listener), "")
    except MisfitError as misfit:
        if camera.h264 == "pass":
            hint = "set the camera so, or let it be encoded (h264: auto)"
            raise UserError(f"camera {camera.id}: h264: pass: {misfit}; {hint}") from misfit
        return Own(None, str(misfit))
    except UserError as error:
        away = source_kind(camera.source) is SourceKind.STREAM
        raise (UnavailableError if away else UserError)(f"camera {camera.id}: {error}") from error


def _opened(config: Config, camera: CameraSettings, listener: LiveSound | None) -> OwnSource:
    match source_kind(camera.source):
        case SourceKind.STREAM:
            return OwnStream(camera.source, camera.options, listener, wanted_by(config))
        case SourceKind.FILE:
            return OwnRecording(camera.source, camera.offset, camera.at_end, wanted_by(config))
        case _:
            raise MisfitError("there is no H.264 in single images")
