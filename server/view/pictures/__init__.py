"""Streams that need decoding: JPEG and boxes burnt in, made in processes of their own for whoever watches."""

from server.view.pictures.pictures import CameraView, FullError, PersonView, Pictures, Subject
from server.view.pictures.series import Series
from server.view.pictures.source import NoPictureError, Source

__all__ = [
    "CameraView",
    "FullError",
    "NoPictureError",
    "PersonView",
    "Pictures",
    "Series",
    "Source",
    "Subject",
]
