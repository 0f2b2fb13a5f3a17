"""The streams: one per person and one per camera, made of references to the cameras' fragments."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from server.view.choice.decide import GopDecision
from server.view.media.agreement import Agreement
from server.view.media.picture import Picture
from server.view.streams.channel import Channel
from server.view.streams.kinds import DecidedStream, Gop, LiveStream
from server.view.streams.prefer import Preferring
from server.view.streams.reel import Reel, plan
from server.view.streams.shelf import Shelf
from server.view.streams.sound import SoundShelf
from server.view.streams.timeline import Timeline
from server.wire.config import Config

_SILENT_S = 2
"""How long behind the decisions a camera's stream may be before it is filled: its pictures may still come."""


class Splicer:
    """Cuts from camera to camera by passing on other bytes: nothing is decoded or encoded here."""

    def __init__(
        self,
        shelves: Mapping[str, Shelf],
        agreement: Agreement,
        config: Config,
        sound: SoundShelf | None = None,
    ) -> None:
        self._shelves, self._agreement, self._config = shelves, agreement, config
        self._sound = sound
        site, http = config.site, config.http
        self.plan = plan(site.fps, config.encode.gop, http.hls_segment_s, http.hls_window_s)
        self._live = {
            camera: LiveStream(self._channel(), self._time(), site.fps, sound) for camera in shelves
        }
        self._decided = {camera: self._stream() for camera in shelves}
        """Each camera as if it were always chosen."""
        self._people: dict[int, DecidedStream] = {}
        self._gone: dict[int, DecidedStream] = {}
        """Those whose stream has ended a moment ago: players still fetch its end."""
        self.preferring = Preferring(self._stream)
        self._gops = 0
        self.objects: dict[int, Channel] = {}
        self.cameras = {camera: stream.channel for camera, stream in self._live.items()}
        self.decided = {camera: stream.channel for camera, stream in self._decided.items()}

    def frame(self, camera: str, frame: Picture) -> None:
        """Pass a camera's frame on to those who watch that camera."""
        self._live[camera].take(frame)

    def decision(self, decision: GopDecision) -> None:
        """Pass every object's chosen GOP on to those who watch it; a camera's GOP is put together once."""
        fps = self._config.site.fps
        gop = Gop(self._shelves, decision.first, decision.frames, fps, self._gops, self._sound)
        self._gops += 1
        cameras = {choice.number: choice.camera for choice in decision.choices}
        for number, camera in cameras.items():
            if number not in self._people:
                stream = self._people[number] = self._stream()
                self.objects[number] = stream.channel
            self._people[number].show(camera, gop)
        # The streams of numbers that turned out to be another's go on with that person.
        for lost, kept in decision.merged.items():
            if lost in self._people and kept in cameras and lost not in cameras:
                self._people[lost].show(cameras[kept], gop)
        for camera, decided in self._decided.items():
            decided.show(camera, gop)
        self.preferring.show(decision, gop)
        for live in self._live.values():
            live.fill(decision.first - round(_SILENT_S * fps))
        self._forget_gone(decision.first)

    def forget(self, known: Collection[int], merged: Collection[int]) -> None:
        """End the streams of those whom nobody remembers any more, and of numbers that are another's now.

        The latter last as long as anybody watches them: who comes later is given that person's.
        """
        watched = {it for it in merged if it in self.objects and self.objects[it].viewers}
        for number in [it for it in self.objects if it not in known and it not in watched]:
            del self.objects[number]
            self._gone[number] = self._people.pop(number)
            self._gone[number].close()
        self.preferring.forget({*known, *merged})

    def reel(self, number: int) -> Reel | None:
        """Give the newest segments of an object's stream, for a while even when it has ended."""
        stream = self._people.get(number) or self._gone.get(number)
        return None if stream is None else stream.reel

    def camera_reel(self, camera: str) -> Reel | None:
        """Give the newest segments of a camera."""
        stream = self._decided.get(camera)
        return None if stream is None else stream.reel

    def _forget_gone(self, pulse: int) -> None:
        kept = 2 * self.plan.listed * self.plan.frames
        for number in [it for it, stream in self._gone.items() if stream.reel.until < pulse - kept]:
            del self._gone[number]

    def _channel(self) -> Channel:
        return Channel(queue_starts=self._config.http.viewer_queue_gops)

    def _time(self) -> Timeline:
        return Timeline(self._agreement, self._config.site.fps, self._config.encode.gop)

    def _stream(self) -> DecidedStream:
        return DecidedStream(self._channel(), self._time(), Reel(self.plan))

    @property
    def viewers(self) -> int:
        """How many streams are being watched."""
        channels = [*self.objects.values(), *self.cameras.values(), *self.decided.values()]
        return sum(channel.viewers for channel in channels) + self.preferring.viewers

    def close(self) -> None:
        """End all streams."""
        for stream in [*self._people.values(), *self._decided.values()]:
            stream.close()
        self.preferring.close()
        for channel in self.cameras.values():
            channel.close()
