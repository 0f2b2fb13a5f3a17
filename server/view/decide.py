"""Which camera shows whom: one decision per GOP for all objects at once (paper, section III)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview import NO_CAMERA, choose_views, size_quality, view_cost
from server.view.align import Epoch
from server.view.people import People
from server.wire.config import Config
from server.wire.messages import Box

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ObjectChoice:
    """The view of one object in one GOP, and why."""

    number: int
    camera: str | None
    """None: no camera can be shown."""
    before: str | None
    """The camera of the GOP before."""
    costs: dict[str, float | None]
    """Mean cost of each camera over the look-ahead; None where it cannot be shown."""
    seen: dict[str, float]
    """Share of the look-ahead's frames in which each camera sees the object."""
    away: bool
    """No camera has seen the object for a while; its stream stays where it was."""


@dataclass(frozen=True, slots=True)
class GopDecision:
    """All objects' views for the frames ``first … first + frames - 1``."""

    first: int
    frames: int
    choices: tuple[ObjectChoice, ...]
    boxes: dict[str, list[dict[int, Box]]]
    """Per camera and frame: everybody's final box by number."""
    merged: dict[int, int]
    """Numbers that turned out to be another's, up to now."""


def homographies(config: Config) -> dict[str, Floats | None]:
    """Give every camera's homography from its own picture to the ground, None where there is none."""
    return {
        camera.id: None if camera.ground is None else np.array(camera.ground, dtype=np.float64)
        for camera in config.cameras
    }


class Decider:
    """Decides GOP by GOP as the epochs come in. No clock, no network: the same epochs give the same cuts.

    ``has(camera, pulse)`` tells whether a camera's frame can be shown.
    """

    def __init__(
        self, config: Config, homographies: Mapping[str, Floats | None], has: Callable[[str, int], bool]
    ) -> None:
        self._config = config
        self._cameras: Sequence[str] = config.camera_ids
        self._has = has
        size = (config.site.width, config.site.height)
        self.people = People(config.view.identity, self._cameras, homographies, size)
        self.switch_cost = config.view.switch_cost_s * config.site.fps
        self._previous: dict[int, int] = {}
        self._next_gop: int | None = None
        self._known_to = -1

    def step(self, epoch: Epoch) -> list[GopDecision]:
        """Take an epoch in; give the GOPs whose look-ahead it completes."""
        gop, lookahead = self._config.encode.gop, self._config.view.lookahead
        if self._next_gop is None:
            start = epoch.last - self._config.track.window.stride + 1
            self._next_gop = -(-start // gop) * gop
        self.people.update(epoch)
        self._known_to = epoch.last
        decisions = []
        while self._next_gop + lookahead - 1 <= self._known_to:
            decisions.append(self._decide(self._next_gop, gop, lookahead))
        return decisions

    def finish(self, last: int) -> list[GopDecision]:
        """Decide what is left when every recording is over; ``last`` is the last frame of the longest."""
        decisions = []
        self._known_to = last
        while self._next_gop is not None and self._next_gop <= last:
            left = last + 1 - self._next_gop
            frames = min(self._config.encode.gop, left)
            decisions.append(self._decide(self._next_gop, frames, min(self._config.view.lookahead, left)))
        return decisions

    def _decide(self, first: int, frames: int, lookahead: int) -> GopDecision:
        people = self.people
        window = [
            {camera: people.boxes(camera, pulse) for camera in self._cameras}
            for pulse in range(first, first + lookahead)
        ]
        objects = [number for number in people.known if people.first_seen[number] < first + frames]
        cost = self._cost(objects, window, first)
        previous = np.array([self._previous.get(number, NO_CAMERA) for number in objects], dtype=np.int64)
        cut_allowed = np.arange(lookahead) % self._config.encode.gop == 0
        views = choose_views(cost, previous, self.switch_cost, cut_allowed).views
        choices = []
        for row, number in enumerate(objects):
            chosen = int(views[row, 0])
            choices.append(self._choice(number, chosen, cost[row], window))
            if chosen != NO_CAMERA:
                self._previous[number] = chosen
        self._next_gop = first + self._config.encode.gop
        self._previous = {who: view for who, view in self._previous.items() if who in people.first_seen}
        boxes = {camera: [window[place][camera] for place in range(frames)] for camera in self._cameras}
        people.forget_boxes_before(self._next_gop)
        return GopDecision(first, frames, tuple(choices), boxes, dict(people.merged))

    def _cost(
        self, objects: Sequence[int], window: Sequence[Mapping[str, Mapping[int, Box]]], first: int
    ) -> Floats:
        """Give c(n, b) ``(objects, frames, cameras)``: 1 - size of the box; infinite without a picture."""
        boxes = np.full((len(objects), len(window), len(self._cameras), 4), np.nan)
        row_of = {number: row for row, number in enumerate(objects)}
        shown = np.ones((len(window), len(self._cameras)), dtype=np.bool_)
        for place, frame in enumerate(window):
            for column, camera in enumerate(self._cameras):
                shown[place, column] = self._has(camera, first + place)
                for number, box in frame[camera].items():
                    if number in row_of:
                        boxes[row_of[number], place, column] = box
        cost = view_cost(size_quality(boxes, self._config.site.width, self._config.site.height))
        return np.where(shown[None, :, :], cost, np.inf)

    def _choice(
        self, number: int, chosen: int, cost: Floats, window: Sequence[Mapping[str, Mapping[int, Box]]]
    ) -> ObjectChoice:
        before = self._previous.get(number, NO_CAMERA)
        means = np.mean(cost, axis=0)
        return ObjectChoice(
            number=number,
            camera=None if chosen == NO_CAMERA else self._cameras[chosen],
            before=None if before == NO_CAMERA else self._cameras[before],
            costs={
                camera: float(mean) if np.isfinite(mean) else None
                for camera, mean in zip(self._cameras, means, strict=True)
            },
            seen={
                camera: sum(number in frame[camera] for frame in window) / len(window)
                for camera in self._cameras
            },
            away=number in self.people.away,
        )
