"""A camera's second, smaller stream, in which people are detected and tracked."""

from __future__ import annotations

from server.camera.substream.opening import open_tracked_pictures
from server.camera.substream.picture_scale import PictureScale
from server.camera.substream.tracked_pictures import TrackedPictures

__all__ = ["PictureScale", "TrackedPictures", "open_tracked_pictures"]
