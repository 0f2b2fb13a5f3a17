"""Three simulated ONVIF cameras that show the synthetic room over RTSP, with a main and a sub stream each."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from functools import cache

import cv2
import numpy as np

from fakes.media.rtsp_camera import RtspCamera
from fakes.setup.onvif_camera import FakeProfile, OnvifCamera, onvif_cameras
from server.camera.encoder import AccessUnit, Encoder
from server.config.sections import EncodeSettings, SiteSettings
from synthetic import Scene

NAMES = ("door", "hall", "stairs")
LOGIN = ("viewer", "p@ss/w:rd")
FPS = 10.0
MAIN, SUB = (320, 180), (160, 90)
_FRAMES = 100
_START = 200
"""The scene's frame at which the streams begin: people are in view."""
_GOP = 10


@cache
def room() -> Scene:
    """Return the scene that the main streams show."""
    return Scene("room", len(NAMES), 4, 1, *MAIN, FPS)


@cache
def _images(camera: int) -> list[np.ndarray[tuple[int, ...], np.dtype[np.uint8]]]:
    return [room().image(camera, _START + pulse) for pulse in range(_FRAMES)]


@cache
def _gops(camera: int, size: tuple[int, int]) -> list[list[AccessUnit]]:
    """Encode a camera's view of the room in groups of pictures."""
    settings = SiteSettings(width=size[0], height=size[1], fps=FPS)
    encoder = Encoder(settings, EncodeSettings(gop_s=_GOP / FPS))
    units = []
    for pulse, image in enumerate(_images(camera)):
        units.append(encoder.encode(pulse, np.asarray(cv2.resize(image, size), dtype=np.uint8)))
    return [units[at : at + _GOP] for at in range(0, _FRAMES, _GOP)]


@contextlib.contextmanager
def room_cameras() -> Iterator[str]:
    """Run the cameras; yield the value of MYVIEW_DISCOVERY by which they are found."""
    with contextlib.ExitStack() as stack:
        cameras = []
        for number, name in enumerate(NAMES):
            profiles = []
            for kind, size in (("main", MAIN), ("sub", SUB)):
                stream = RtspCamera(_gops(number, size), FPS, login=LOGIN, live=True)
                stack.callback(stream.close)
                profiles.append(FakeProfile(kind, stream.url, *size, int(FPS)))
            cameras.append(OnvifCamera(name, profiles, LOGIN))
        yield stack.enter_context(onvif_cameras(*cameras))
