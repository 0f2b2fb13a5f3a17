"""Opens the pictures in which a camera's people are tracked."""

from __future__ import annotations

from server.camera.passthrough.encoder import PassthroughSource
from server.camera.sources import FrameSource, open_source
from server.camera.substream.live_substream import LiveSubstream
from server.camera.substream.picture_buffer import PictureBuffer
from server.camera.substream.picture_scale import PictureScale, SubstreamPlacement, choose_scale
from server.camera.substream.tracked_pictures import (
    LiveSubstreamPictures,
    MainPictures,
    RecordedSubstreamPictures,
    TrackedPictures,
)
from server.config.sections import CameraSettings
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.media.letterbox import Letterbox
from server.system.errors import UserError
from tracking.registry import needs_images

_KEPT_S = 2.0
"""Seconds by which a stream that is decoded may be later than its substream."""
_GOPS_BEHIND = 2
"""GOPs by which a stream that is passed through may be later."""


def open_tracked_pictures(
    config: Config,
    camera: CameraSettings,
    main: FrameSource,
    letterbox: Letterbox,
    passthrough: PassthroughSource | None,
) -> TrackedPictures:
    """Open a camera's substream, if it has one.

    A network camera's may be away: it is waited for a few seconds, and tried again meanwhile.

    Args:
        config: the site.
        camera: the camera.
        main: its main stream.
        letterbox: of that.
        passthrough: the same, if it is passed through.

    Raises:
        UserError: a recording cannot be opened.
    """
    if camera.substream is None:
        return MainPictures(main, letterbox)
    if source_kind(camera.substream) is SourceKind.STREAM:
        return _open_live(config, camera, camera.substream, letterbox, passthrough)
    try:
        source = open_source(
            camera.model_copy(update={"source": camera.substream, "at_end": "stop"}), config.site
        )
    except UserError as error:
        text = str(error).removeprefix(f"camera {camera.id}: ")
        raise UserError(f"camera {camera.id}: substream: {text}") from error
    scale = _scale(config, letterbox, source.size)
    placement = SubstreamPlacement(letterbox.camera_size, scale)
    return RecordedSubstreamPictures(camera.id, main, source, placement, scale)


def _open_live(
    config: Config,
    camera: CameraSettings,
    address: str,
    letterbox: Letterbox,
    passthrough: PassthroughSource | None,
) -> LiveSubstreamPictures:
    keep_s = _KEPT_S
    if passthrough is not None:
        keep_s += _GOPS_BEHIND * config.gop / config.site.fps
    reader = LiveSubstream(address, camera.options, PictureBuffer(keep_s, 0.5 / config.site.fps))
    scale = _scale(config, letterbox, reader.size)
    placement = SubstreamPlacement(letterbox.camera_size, scale)
    return LiveSubstreamPictures(camera.id, reader, placement, scale, passthrough)


def _scale(config: Config, letterbox: Letterbox, size: tuple[int, int] | None) -> PictureScale:
    """Return the scale of the tracked picture; trackers that need images need those of the site's size."""
    if needs_images(config.track.tracker):
        return PictureScale(letterbox.site_size, letterbox.site_size)
    return choose_scale(letterbox.site_size, letterbox.camera_size, size)
