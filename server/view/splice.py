"""The streams: one per person and one per camera, made of references to the cameras' fragments."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from server.view.agreement import Agreement
from server.view.channel import Channel
from server.view.decide import GopDecision
from server.view.footage import Footage, Picture
from server.view.shelf import Shelf
from server.view.timeline import Timeline
from server.wire.config import Config

_SILENT_S = 2
"""How long behind the decisions a camera's stream may be before it is filled: its pictures may still come."""


@dataclass(slots=True)
class _Stream:
    channel: Channel
    time: Timeline
    camera: str | None = None
    """Whom it showed last."""

    def send(self, footage: Footage) -> None:
        """Send pictures that follow, whoever else is sent them."""
        for picture in footage.pictures:
            self.time.take(picture)
        self.channel.publish(footage)

    def fill(self, until: int) -> None:
        """Repeat the last picture, if there is one, up to a pulse."""
        filled = self.time.fill(until)
        if filled:
            self.channel.publish(Footage(filled, fills=True))


class Splicer:
    """Cuts from camera to camera by passing on other bytes: nothing is decoded or encoded here."""

    def __init__(self, shelves: Mapping[str, Shelf], agreement: Agreement, config: Config) -> None:
        self._shelves, self._agreement, self._config = shelves, agreement, config
        self._objects: dict[int, _Stream] = {}
        self._cameras = {camera: self._stream() for camera in shelves}
        self.objects: dict[int, Channel] = {}
        self.cameras = {camera: stream.channel for camera, stream in self._cameras.items()}

    def frame(self, camera: str, frame: Picture) -> None:
        """Pass a camera's frame on to those who watch that camera."""
        stream = self._cameras[camera]
        for picture in stream.time.take(frame):
            stream.channel.publish(Footage([picture]))

    def decision(self, decision: GopDecision) -> None:
        """Pass every object's chosen GOP on to those who watch it; a camera's GOP is put together once."""
        gops: dict[str, Footage] = {}
        for choice in decision.choices:
            if choice.number not in self._objects:
                stream = self._objects[choice.number] = self._stream()
                self.objects[choice.number] = stream.channel
            self._show(self._objects[choice.number], choice.camera, decision, gops)
        self._follow_merges(decision, gops)
        for stream in self._cameras.values():
            stream.fill(decision.first - round(_SILENT_S * self._config.site.fps))

    def forget(self, known: Collection[int]) -> None:
        """End the streams of those whom nobody remembers any more."""
        for number in [number for number in self.objects if number not in known]:
            self.objects.pop(number).close()
            del self._objects[number]

    def _stream(self) -> _Stream:
        site, settings = self._config.site, self._config.http
        time = Timeline(self._agreement, site.fps, self._config.encode.gop)
        return _Stream(Channel(queue_starts=settings.viewer_queue_gops), time)

    def _show(
        self, stream: _Stream, camera: str | None, decision: GopDecision, gops: dict[str, Footage]
    ) -> None:
        stream.fill(decision.first)
        if camera is None:
            self._bridge(stream, decision)
            return
        if camera not in gops:
            gops[camera] = Footage(self._shelves[camera].pictures(decision.first, decision.frames))
        stream.camera = camera
        stream.send(gops[camera])

    def _bridge(self, stream: _Stream, decision: GopDecision) -> None:
        """Show what has come of the camera that was shown before; where that is nothing, its last picture."""
        until = decision.first + decision.frames
        shelf = None if stream.camera is None else self._shelves[stream.camera]
        came = shelf.pictures(decision.first, decision.frames) if shelf else []
        pictures = [shown for picture in came for shown in stream.time.take(picture)]
        pictures += stream.time.fill(until)
        if pictures:
            stream.channel.publish(Footage(pictures, fills=not pictures[0].key))

    def _follow_merges(self, decision: GopDecision, gops: dict[str, Footage]) -> None:
        """Let the streams of numbers that turned out to be another's go on with that person."""
        cameras = {choice.number: choice.camera for choice in decision.choices}
        for lost, kept in decision.merged.items():
            if lost in self._objects and kept in cameras and lost not in cameras:
                self._show(self._objects[lost], cameras[kept], decision, gops)

    @property
    def viewers(self) -> int:
        """How many streams are being watched."""
        channels = [*self.objects.values(), *self.cameras.values()]
        return sum(channel.viewers for channel in channels)

    def close(self) -> None:
        """End all streams."""
        for channel in [*self.objects.values(), *self.cameras.values()]:
            channel.close()
