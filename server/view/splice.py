"""The streams: one per person and one per camera, made of references to the cameras' fragments."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from server.view.channel import Channel, Chunk
from server.view.decide import GopDecision
from server.view.shelf import Shelf, Shelved
from server.wire.config import Http


class Splicer:
    """Cuts from camera to camera by passing on other bytes: nothing is decoded or encoded here."""

    def __init__(self, shelves: Mapping[str, Shelf], settings: Http) -> None:
        self._shelves = shelves
        self._queue = settings.viewer_queue_gops
        self.objects: dict[int, Channel] = {}
        self.cameras = {camera: Channel(queue_starts=self._queue) for camera in shelves}

    def frame(self, camera: str, frame: Shelved) -> None:
        """Pass a camera's frame on to those who watch that camera."""
        self.cameras[camera].publish(Chunk(frame.fragment, frame.key))

    def decision(self, decision: GopDecision) -> None:
        """Pass every object's chosen GOP on to those who watch it; a camera's GOP is put together once."""
        gops: dict[str, Chunk] = {}
        for choice in decision.choices:
            channel = self.objects.get(choice.number)
            if channel is None:
                channel = self.objects[choice.number] = Channel(queue_starts=self._queue)
            if choice.camera is None:
                continue
            if choice.camera not in gops:
                gop = self._shelves[choice.camera].gop(decision.first, decision.frames)
                gops[choice.camera] = Chunk(gop, start=True)
            channel.publish(gops[choice.camera])
        self._follow_merges(decision, gops)

    def forget(self, known: Collection[int]) -> None:
        """End the streams of those whom nobody remembers any more."""
        for number in [number for number in self.objects if number not in known]:
            self.objects.pop(number).close()

    def _follow_merges(self, decision: GopDecision, gops: Mapping[str, Chunk]) -> None:
        """Let the streams of numbers that turned out to be another's go on with that person."""
        cameras = {choice.number: choice.camera for choice in decision.choices}
        for lost, kept in decision.merged.items():
            camera = cameras.get(kept)
            if lost in self.objects and camera is not None:
                self.objects[lost].publish(gops[camera])

    @property
    def viewers(self) -> int:
        """How many streams are being watched."""
        channels = [*self.objects.values(), *self.cameras.values()]
        return sum(channel.viewers for channel in channels)

    def close(self) -> None:
        """End all streams."""
        for channel in [*self.objects.values(), *self.cameras.values()]:
            channel.close()
