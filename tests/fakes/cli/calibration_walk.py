"""A person who walks through the synthetic room, as track messages, and the error of a calibration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestview import to_ground
from fakes.service.scripted_cameras import STRIDE, small_config
from server.config.site_config import Config
from server.messaging.messages import Box, CameraTracks, TrackMessage
from server.messaging.packed_arrays import pack_boxes
from server.service.ingest.epoch_aligner import Epoch
from synthetic import Scene
from synthetic.cameras.pinhole import PinholeCamera
from synthetic.room.room_world import RoomWorld

Floats = NDArray[np.float64]

WIDTH, HEIGHT = 320, 180
PERSON_HEIGHT = 1.75  # meters
SITE = {"site": {"name": "hall", "width": WIDTH, "height": HEIGHT}}


def walk_config(**changes: Any) -> Config:
    """Return a configuration with the scene's picture size."""
    return small_config(**{**SITE, **changes})


def curved_path(frames: int, wide: float = 0.3) -> Floats:
    """Return a curved path through the middle of the scene's floor, `(frames, 2)` meters."""
    width, depth = Scene("room", 2, 1).floor
    time = np.arange(frames)
    return np.column_stack(
        [
            width * (0.5 + wide * np.sin(time / 47.0)),
            depth * (0.5 + wide * np.sin(time / 31.0 + 1)),
        ]
    )


def walk_epochs(config: Config, places: Floats, epoch: int = 0, boot: int = 1) -> Iterator[Epoch]:
    """Yield the cameras' track messages of a walking person, from an epoch on; only complete windows."""
    ids = config.camera_ids
    scene = Scene("room", len(ids), 1, width=WIDTH, height=HEIGHT)
    for number in range(epoch, epoch + len(places) // STRIDE):
        first = number * STRIDE
        part = places[first - epoch * STRIDE :][:STRIDE]
        messages = {
            camera: _message(camera, [_box(scene, at, place) for place in part], number, boot)
            for at, camera in enumerate(ids)
        }
        yield Epoch(number, first + STRIDE - 1, messages)


def _message(camera: str, boxes: list[Box | None], epoch: int, boot: int) -> CameraTracks:
    first, last = epoch * STRIDE, (epoch + 1) * STRIDE - 1
    track = TrackMessage(id=1, boxes=pack_boxes(boxes), confidence=1.0)
    return CameraTracks(
        camera=camera,
        boot=boot,
        size=(WIDTH, HEIGHT),
        epoch=epoch,
        first=first,
        last=last,
        final_to=last,
        ended=False,
        shed=[],
        tracks=[track] if any(boxes) else [],
        solve=None,
    )


def _view(scene: Scene, camera: int) -> PinholeCamera:
    assert isinstance(scene.world, RoomWorld)
    return scene.world.view(camera)


def _box(scene: Scene, camera: int, place: Floats) -> Box | None:
    """Return a person's box in a camera's picture; None if it is truncated."""
    ends, depth = _view(scene, camera).project(np.array([[*place, 0.0], [*place, PERSON_HEIGHT]]))
    (x, bottom), (_, top) = ends.tolist()
    half = (bottom - top) / 5
    whole = depth.min() > 0.3 and x - half > 0 and x + half < WIDTH and top > 0 and bottom < HEIGHT
    return (x - half, top, x + half, bottom) if whole else None


def errors_on_floor(found: Sequence[Floats]) -> Floats:
    """Compute the errors of known points, meters, after the best rotation and shift of the floor."""
    scene = Scene("room", len(found), 1, width=WIDTH, height=HEIGHT)
    width, depth = scene.floor
    random = np.random.default_rng(0)
    places = random.uniform((0.3 * width, 0.3 * depth), (0.7 * width, 0.7 * depth), (50, 2))
    standing = np.column_stack([places, np.zeros(len(places))])
    seen = [
        to_ground(homography, _view(scene, at).project(standing)[0]) for at, homography in enumerate(found)
    ]
    x = np.concatenate(seen) @ np.array([1, 1j])
    y = np.tile(places @ np.array([1, 1j]), len(found))
    x, y = x - x.mean(), y - y.mean()
    return np.abs(x * np.exp(1j * np.angle((np.conj(x) * y).sum())) - y)
