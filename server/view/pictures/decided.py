"""The boxes that go with decided frames, and cameras' frames with a decision, for whoever draws."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from server.view.channel import Channel, Chunk
from server.view.fmp4 import TIMESCALE
from server.view.shelf import Shelf
from server.wire.drawing import Boxes
from server.wire.messages import GopChoices

_TFDT = b"tfdt"


@dataclass(frozen=True, slots=True)
class Told:
    """What is known of the frames of one GOP in one camera."""

    first: int
    boxes: Boxes
    chosen: int | None = None


NOTHING = Told(0, [])


def first_pulse(fragments: bytes, fps: float) -> int:
    """Give the pulse that fragments begin with."""
    at = fragments.index(_TFDT) + len(_TFDT) + 4  # behind version and flags
    (ticks,) = struct.unpack_from(">Q", fragments, at)
    return round(int(ticks) * fps / TIMESCALE)


class Decided:
    """Keeps the newest ``gops`` decisions; ``resolve`` gives the number that a merged one goes by now."""

    def __init__(
        self, shelves: Mapping[str, Shelf], resolve: Callable[[int], int], fps: float, gops: int
    ) -> None:
        self._shelves, self._resolve, self._fps, self._gops = shelves, resolve, fps, gops
        self._kept: deque[GopChoices] = deque(maxlen=gops)
        self._cameras: dict[str, Channel] = {}

    def put(self, choices: GopChoices) -> None:
        """Take a decision in, and pass its frames of the cameras on that are drawn."""
        self._kept.append(choices)
        for camera, channel in self._cameras.items():
            self._pass_on(camera, channel, choices)

    def camera(self, camera: str) -> Channel:
        """Give the stream of a camera's decided GOPs; it begins with the newest."""
        channel = self._cameras.get(camera)
        if channel is None:
            channel = self._cameras[camera] = Channel(queue_starts=self._gops)
            if self._kept:
                self._pass_on(camera, channel, self._kept[-1])
        return channel

    def newest(self, camera: str) -> int | None:
        """Give the last frame of a camera's newest decided GOP; None: it is not there."""
        last = self._kept[-1] if self._kept else None
        return last.first + last.frames - 1 if last is not None and self._has(camera, last) else None

    def leave(self, camera: str) -> None:
        """Let the stream of a camera go."""
        self._cameras.pop(camera).close()

    def of_camera(self, camera: str, fragments: bytes) -> Told:
        """Give everybody's boxes in a camera's GOP."""
        choices = self._of(fragments)
        return NOTHING if choices is None else Told(choices.first, choices.boxes.get(camera, []))

    def of_person(self, number: int, fragments: bytes) -> Told:
        """Give everybody's boxes in a GOP of a person's stream, and the number that the person has there."""
        choices = self._of(fragments)
        if choices is None:
            return NOTHING
        there = number if number in choices.choices else self._resolve(number)
        camera = choices.choices.get(there)
        return NOTHING if camera is None else Told(choices.first, choices.boxes.get(camera, []), there)

    def close(self) -> None:
        """End the cameras' streams."""
        for channel in self._cameras.values():
            channel.close()

    def _of(self, fragments: bytes) -> GopChoices | None:
        pulse = first_pulse(fragments, self._fps)
        return next((it for it in self._kept if it.first <= pulse < it.first + it.frames), None)

    def _pass_on(self, camera: str, channel: Channel, choices: GopChoices) -> None:
        if self._has(camera, choices):
            gop = self._shelves[camera].gop(choices.first, choices.frames)
            channel.publish(Chunk(gop, start=True))

    def _has(self, camera: str, choices: GopChoices) -> bool:
        shelf = self._shelves[camera]
        return all(shelf.has(pulse) for pulse in range(choices.first, choices.first + choices.frames))
