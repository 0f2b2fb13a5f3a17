"""The streams: one per person and one per camera, made of references to the cameras' fragments."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from server.config.site_config import Config
from server.media.picture import Picture
from server.media.stream_format import Agreement
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.gapless_timeline import GaplessTimeline
from server.service.streaming.hls_segmenter import HlsSegmenter, segment_layout
from server.service.streaming.person_streams import PersonStreams
from server.service.streaming.preferred_camera import PreferredCameraStreams
from server.service.streaming.presence import PresenceLog
from server.service.streaming.spliced_stream import GopAssembler, LiveStream, SplicedStream
from server.service.view_selection.decider import GopDecision

_SILENT_S = 2
"""How long behind the decisions a camera's stream may be before it is filled: its pictures may still come."""


class Splicer:
    """Cuts from camera to camera by passing on other bytes: nothing is decoded or encoded here.

    Who may see one person alone watches streams of their own (``scoped``): there the person's picture gives
    way to grey while nobody has seen them for long. Only a site with tokens has any.
    """

    def __init__(
        self,
        shelves: Mapping[str, FrameBuffer],
        agreement: Agreement,
        config: Config,
        sound: AudioBuffer | None = None,
    ) -> None:
        self._shelves, self._agreement, self._config = shelves, agreement, config
        self._sound = sound
        site, http = config.site, config.http
        self.plan = segment_layout(site.fps, config.encode.gop, http.hls_segment_s, http.hls_window_s)
        self._live = {
            camera: LiveStream(self._channel(), self._time(), site.fps, sound) for camera in shelves
        }
        self._decided = {camera: self._stream() for camera in shelves}
        """Each camera as if it were always chosen."""
        self._presence = PresenceLog(round(config.access.unseen_s * site.fps))
        self._is_scoped = config.access.tokens is not None
        self._people = PersonStreams(self._stream)
        self._scoped = PersonStreams(self._stream, self._presence.of)
        self.preferring = PreferredCameraStreams(self._stream)
        self.preferring_scoped = PreferredCameraStreams(self._stream, self._presence.of)
        self._gops = 0
        self.objects = self._people.channels
        self.scoped = self._scoped.channels
        self.cameras = {camera: stream.channel for camera, stream in self._live.items()}
        self.decided = {camera: stream.channel for camera, stream in self._decided.items()}

    def frame(self, camera: str, frame: Picture) -> None:
        """Pass a camera's frame on to those who watch that camera."""
        self._live[camera].take(frame)

    def decision(self, decision: GopDecision) -> None:
        """Pass every object's chosen GOP on to those who watch it; a camera's GOP is put together once."""
        fps = self._config.site.fps
        gop = GopAssembler(self._shelves, decision.first, decision.frames, fps, self._gops, self._sound)
        self._gops += 1
        cameras = {choice.number: choice.camera for choice in decision.choices}
        self._people.show(cameras, decision.merged, gop)
        if self._is_scoped:
            self._presence.take(decision)
            self._scoped.show(cameras, decision.merged, gop)
        for camera, decided in self._decided.items():
            decided.show(camera, gop)
        self.preferring.show(decision, gop)
        self.preferring_scoped.show(decision, gop)
        for live in self._live.values():
            live.fill(decision.first - round(_SILENT_S * fps))
        ended = decision.first - 2 * self.plan.listed * self.plan.frames
        for streams in (self._people, self._scoped):
            streams.forget_ended_before(ended)

    def forget(self, known: Collection[int], merged: Collection[int]) -> None:
        """End the streams of those whom nobody remembers any more, and of numbers that are another's now.

        The latter last as long as anybody watches them: who comes later is given that person's.
        """
        watched = {it for it in merged if self.watched(it)}
        for streams in (self._people, self._scoped):
            streams.forget({*known, *watched})
        self._presence.forget({*known, *watched})
        for preferring in (self.preferring, self.preferring_scoped):
            preferring.forget({*known, *merged})

    def watched(self, number: int) -> int:
        """Return how many watch an object's stream."""
        return self._people.watched(number) + self._scoped.watched(number)

    def reel(self, number: int, *, scoped: bool = False) -> HlsSegmenter | None:
        """Give the newest segments of an object's stream, for a while even when it has ended."""
        return (self._scoped if scoped else self._people).reel(number)

    def camera_reel(self, camera: str) -> HlsSegmenter | None:
        """Give the newest segments of a camera."""
        stream = self._decided.get(camera)
        return None if stream is None else stream.reel

    def _channel(self) -> Broadcaster:
        return Broadcaster(queue_starts=self._config.http.viewer_queue_gops)

    def _time(self) -> GaplessTimeline:
        return GaplessTimeline(self._agreement, self._config.site.fps, self._config.encode.gop)

    def _stream(self) -> SplicedStream:
        return SplicedStream(self._channel(), self._time(), HlsSegmenter(self.plan))

    @property
    def viewers_of_objects(self) -> int:
        """How many streams of objects are being watched, but those in which a camera is preferred."""
        return self._people.viewers + self._scoped.viewers

    @property
    def viewers_who_prefer(self) -> int:
        """How many streams are being watched in which a camera is preferred."""
        return self.preferring.viewers + self.preferring_scoped.viewers

    @property
    def viewers(self) -> int:
        """How many streams are being watched."""
        channels = [*self.cameras.values(), *self.decided.values()]
        watched = sum(channel.viewers for channel in channels)
        return watched + self.viewers_of_objects + self.viewers_who_prefer

    def close(self) -> None:
        """End all streams."""
        for streams in (self._people, self._scoped, self.preferring, self.preferring_scoped):
            streams.close()
        for stream in self._decided.values():
            stream.close()
        for channel in self.cameras.values():
            channel.close()
