"""Frame sources: network cameras, recordings, image folders, synthetic scenes."""

from __future__ import annotations

from server.camera.audio import LiveAudioSource
from server.camera.sources.base import FrameSource, Image, SourceEndedError
from server.camera.sources.image_folder import ImageFolder
from server.camera.sources.live_stream import LiveStream
from server.camera.sources.recording import Recording
from server.camera.sources.synthetic import SyntheticSource
from server.config.sections import CameraSettings, SiteSettings
from server.config.source_address import SourceKind, source_kind
from server.system.errors import UnavailableError, UserError

__all__ = ["FrameSource", "Image", "ImageFolder", "Recording", "SourceEndedError", "open_source"]


def open_source(
    camera: CameraSettings,
    site: SiteSettings,
    listener: LiveAudioSource | None = None,
    *,
    warm_up: bool = True,
) -> FrameSource:
    """Open a camera's source; a network camera's audio is passed to ``listener``, if given.

    ``warm_up``: prepare for the first pulse; otherwise only check that it opens.

    Raises:
        UserError: it cannot be opened; the text says which camera and why.
        UnavailableError: the same, of a network camera or device that may become available.
    """
    try:
        match source_kind(camera.source):
            case SourceKind.SCENE:
                scene = SyntheticSource(camera.source, site)
                if warm_up:
                    scene.warm_up()
                return scene
            case SourceKind.STREAM:
                return LiveStream(camera.source, camera.options, listener)
            case SourceKind.FOLDER:
                return ImageFolder(camera.source, camera.first_pulse(site.fps), camera.at_end)
            case SourceKind.FILE:
                return Recording(camera.source, camera.first_pulse(site.fps), camera.at_end, site.fps)
    except UserError as error:
        # A network camera may be off temporarily; a missing file is permanent.
        is_stream = source_kind(camera.source) is SourceKind.STREAM
        raise (UnavailableError if is_stream else UserError)(f"camera {camera.id}: {error}") from error
