"""Where a camera's pictures come from."""

from __future__ import annotations

from server.camera.audio import LiveSound
from server.camera.sources.base import Image, Source, SourceEnded
from server.camera.sources.image_folder import Folder
from server.camera.sources.live_stream import Stream
from server.camera.sources.recording import Recording
from server.camera.sources.synthetic import Stage
from server.config.sections import Camera, Site
from server.config.source_address import SourceKind, kind_of
from server.system.errors import AwayError, UserError

__all__ = ["Folder", "Image", "Recording", "Source", "SourceEnded", "open_source"]


def open_source(
    camera: Camera, site: Site, listener: LiveSound | None = None, *, ready: bool = True
) -> Source:
    """Open a camera's source; a network camera's sound is handed to ``listener``, if there is one.

    ``ready``: for the first pulse; else it is only looked whether it can be opened.

    Raises:
        UserError: it cannot be opened; the text says which camera and why.
        AwayError: the same, of a network camera or device that may yet come.
    """
    try:
        match kind_of(camera.source):
            case SourceKind.SCENE:
                stage = Stage(camera.source, site)
                return stage.warm_up() if ready else stage
            case SourceKind.STREAM:
                return Stream(camera.source, camera.options, listener)
            case SourceKind.FOLDER:
                return Folder(camera.source, camera.offset, camera.at_end)
            case SourceKind.FILE:
                return Recording(camera.source, camera.offset, camera.at_end, site.fps)
    except UserError as error:
        # A network camera may only be switched off; a file that is not there will not come by itself.
        away = kind_of(camera.source) is SourceKind.STREAM
        raise (AwayError if away else UserError)(f"camera {camera.id}: {error}") from error
