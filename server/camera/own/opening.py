"""Opening a camera whose own H.264 is to be passed on."""

from __future__ import annotations

from dataclasses import dataclass

from server.camera.own.fitting import MisfitError, wanted_by
from server.camera.own.passing import OwnSource
from server.camera.own.recording import OwnRecording
from server.camera.own.stream import OwnStream
from server.camera.sound import LiveSound
from server.wire.config import Config
from server.wire.errors import AwayError, UserError
from server.wire.sections import Camera
from server.wire.sources import SourceKind, kind_of


@dataclass(frozen=True, slots=True)
class Own:
    """What came of it."""

    source: OwnSource | None
    """None: the camera's pictures are to be encoded."""
    why: str
    """Why so; empty where nothing was asked for."""


def open_own(config: Config, camera: Camera, listener: LiveSound | None) -> Own:
    """Open a camera's own H.264, if that is wished.

    Raises:
        UserError: it cannot be opened, or must fit and does not; the text says which camera and why.
        AwayError: the same, of a network camera that may yet come.
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
        away = kind_of(camera.source) is SourceKind.STREAM
        raise (AwayError if away else UserError)(f"camera {camera.id}: {error}") from error


def _opened(config: Config, camera: Camera, listener: LiveSound | None) -> OwnSource:
    match kind_of(camera.source):
        case SourceKind.STREAM:
            return OwnStream(camera.source, camera.options, listener, wanted_by(config))
        case SourceKind.FILE:
            return OwnRecording(camera.source, camera.offset, camera.at_end, wanted_by(config))
        case _:
            raise MisfitError("there is no H.264 in single images")
