"""Rendered streams: JPEG pictures, and video with boxes burnt in, rendered by worker processes on demand."""

from __future__ import annotations

from server.media.rendering_messages import PictureKind
from server.service.rendering.mjpeg_streams import (
    CONTENT_TYPE,
    FIRST_BOUNDARY,
    PULSE_HEADER,
    MjpegVariant,
    part_and_boundary,
)
from server.service.rendering.render_pool import (
    CameraView,
    PersonView,
    RenderPool,
    RenderPoolFullError,
    Subject,
)
from server.service.rendering.rendered_stream import PictureTimeoutError, RenderedStream

__all__ = [
    "CONTENT_TYPE",
    "FIRST_BOUNDARY",
    "PULSE_HEADER",
    "CameraView",
    "MjpegVariant",
    "PersonView",
    "PictureKind",
    "PictureTimeoutError",
    "RenderPool",
    "RenderPoolFullError",
    "RenderedStream",
    "Subject",
    "part_and_boundary",
]
