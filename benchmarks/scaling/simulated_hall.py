"""A simulated hall of any size: cameras in a grid, each with about as many walking people in view."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from server.messaging.messages import AppearanceHistogram, CameraTracks, TrackMessage
from server.messaging.packed_arrays import pack_boxes, pack_histograms
from tracking.boxes import Floats

WIDTH, HEIGHT = 640, 360
FPS = 25.0
"""Of the site's configuration."""
WINDOW, STRIDE = 15, 5
_SPACING = 10.0
"""Meters between cameras."""
_NEAREST, _FARTHEST = 5.0, 20.0
"""Meters ahead of a camera in which it sees people: the ground of about three cameras."""
_FOCAL, _EYE, _HORIZON = 400.0, 3.0, 100.0
_TALL, _PACE = 1.75, 0.05
"""Meters, and meters per frame."""
_BINS = 64
_NOISE = 0.02
"""Errors of a box's edges, as a share of its height."""
_LOST_EPOCHS = 2
"""Frames out of view after which a person gets a new track id in a camera."""
_SPOTS = 20_000


@dataclass(frozen=True, slots=True)
class CameraView:
    """The people in a camera's view in one window.

    Attributes:
        people: (K,) rows of the people seen at least once.
        boxes: (K, M, 4) pixels, NaN where out of view.
    """

    people: NDArray[np.int64]
    boxes: Floats


@dataclass(frozen=True)
class SimulatedHall:
    """A hall with `cameras` cameras, each of which sees `per_camera` people on average."""

    cameras: int
    per_camera: int

    @property
    def ids(self) -> list[str]:
        """The cameras' names."""
        return [f"c{number:03d}" for number in range(self.cameras)]

    @cached_property
    def grounds(self) -> list[Floats]:
        """Each camera's homography from the picture to the floor, meters."""
        return [np.asarray(np.linalg.inv(view), dtype=np.float64) for view in self._views]

    @cached_property
    def _views(self) -> list[Floats]:
        side = int(np.ceil(np.sqrt(self.cameras)))
        level = np.array([[_FOCAL, WIDTH / 2, 0.0], [0.0, _HORIZON, _FOCAL * _EYE], [0.0, 1.0, 0.0]])
        views = []
        for number in range(self.cameras):
            x, y = np.array([number % side, number // side]) * _SPACING + _SPACING / 2
            # Half of the cameras look along one axis, half along the other, all away from the nearest wall.
            east, north = np.sign(self._size / 2 - (x, y)) + (self._size / 2 == (x, y))
            ahead = (east, 0.0) if number % 2 else (0.0, north)
            across = (ahead[1], -ahead[0])
            to_camera = [
                [*across, -across[0] * x - across[1] * y],
                [*ahead, -ahead[0] * x - ahead[1] * y],
                [0, 0, 1],
            ]
            views.append(level @ np.array(to_camera))
        return views

    @property
    def _size(self) -> Floats:
        side = int(np.ceil(np.sqrt(self.cameras)))
        return np.array([side, -(-self.cameras // side)]) * _SPACING

    @cached_property
    def people(self) -> int:
        """The number of people."""
        spots = np.random.default_rng(0).uniform(0.0, 1.0, (_SPOTS, 2)) * self._size
        seen = sum(np.count_nonzero(~np.isnan(self._boxes(view, spots)[:, 0])) for view in self._views)
        return round(self.per_camera * self.cameras * _SPOTS / seen)

    @cached_property
    def _walks(self) -> tuple[Floats, Floats]:
        rng = np.random.default_rng(1)
        turn = rng.uniform(0, 2 * np.pi, self.people)
        return (
            rng.uniform(0.0, 1.0, (self.people, 2)) * self._size,
            _PACE * np.stack([np.cos(turn), np.sin(turn)], axis=1),
        )

    @cached_property
    def histograms(self) -> Floats:
        """(people, bins) the appearance of each person."""
        return np.random.default_rng(2).dirichlet(np.full(_BINS, 0.3), self.people)

    def places(self, first: int, last: int) -> Floats:
        """Return the positions (people, frames, 2), meters: straight lines, reflected at the walls."""
        begin, pace = self._walks
        way = begin[:, None] + pace[:, None] * np.arange(first, last + 1)[:, None]
        return np.asarray(self._size - np.abs(way % (2 * self._size) - self._size))

    def view(self, camera: int, places: Floats, seed: int) -> CameraView:
        """Project people into a camera, with seeded errors of the boxes."""
        boxes = self._boxes(self._views[camera], places)
        people = np.flatnonzero(~np.isnan(boxes[..., 0]).all(axis=1))
        boxes = boxes[people]
        tall = (boxes[..., 3] - boxes[..., 1])[..., None]
        return CameraView(people, boxes + np.random.default_rng(seed).normal(0, _NOISE, boxes.shape) * tall)

    @staticmethod
    def _boxes(view: Floats, places: Floats) -> Floats:
        x, y = places[..., 0:1], places[..., 1:2]
        seen = view[:, 0] * x + view[:, 1] * y + view[:, 2]
        ahead = seen[..., 2]
        there = (ahead >= _NEAREST) & (ahead <= _FARTHEST)
        ahead = np.where(there, ahead, np.nan)
        u, v, tall = seen[..., 0] / ahead, seen[..., 1] / ahead, _FOCAL * _TALL / ahead
        u = np.where((u >= 0) & (u < WIDTH), u, np.nan)
        return np.stack([u - 0.2 * tall, v - tall, u + 0.2 * tall, v + 0.0 * u], axis=-1)


class SimulatedTracker:
    """Simulates a camera's tracker: a person who comes back into view gets a new track id."""

    def __init__(self, hall: SimulatedHall, camera: int, boot: int) -> None:
        self._hall, self._camera, self._boot = hall, camera, boot
        self._track: dict[int, int] = {}
        self._seen: dict[int, int] = {}
        self._count = 0

    @property
    def camera(self) -> str:
        """The camera's name."""
        return self._hall.ids[self._camera]

    def visible(self, epoch: int) -> dict[int, int]:
        """Return who was seen in the window that ends with an epoch, by track."""
        return {track: person for person, track in self._track.items() if self._seen[person] == epoch}

    def message(self, epoch: int, places: Floats) -> CameraTracks:
        """Return the message of the window that ends with an epoch; `places` are positions in its frames."""
        last = (epoch + 1) * STRIDE - 1
        first = last + 1 - places.shape[1]
        final_to = max(first - 1, last - (WINDOW - STRIDE))
        view = self._hall.view(self._camera, places, epoch * self._hall.cameras + self._camera)
        tracks = [
            TrackMessage(
                id=self._number(person, epoch),
                boxes=pack_boxes(rows),
                confidence=0.8,
                appearance=self._looks(person, first, final_to),
            )
            for person, rows in zip(view.people.tolist(), view.boxes, strict=True)
        ]
        return CameraTracks(
            camera=self._hall.ids[self._camera],
            boot=self._boot,
            size=(WIDTH, HEIGHT),
            epoch=epoch,
            first=first,
            last=last,
            final_to=final_to,
            ended=False,
            shed=[],
            tracks=tracks,
            solve=None,
        )

    def _looks(self, person: int, first: int, final_to: int) -> list[AppearanceHistogram]:
        if final_to < first:
            return []
        histogram = pack_histograms(self._hall.histograms[person])
        return [AppearanceHistogram(first=first, last=final_to, histogram=histogram)]

    def _number(self, person: int, epoch: int) -> int:
        if epoch - self._seen.get(person, -_LOST_EPOCHS - 1) > _LOST_EPOCHS:
            self._count += 1
            self._track[person] = self._count
        self._seen[person] = epoch
        return self._track[person]
