"""All live streams of a site, one per person and one per camera, composed of the cameras' fragments."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from server.config.site_config import Config
from server.media.picture import EncodedPicture
from server.media.stream_format import StreamFormat
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.gapless_timeline import GaplessTimeline
from server.service.streaming.hls_segmenter import HlsSegmenter, segment_layout
from server.service.streaming.live_person_streams import LivePersonStreams, PictureStream
from server.service.streaming.person_streams import PersonStreams
from server.service.streaming.preferred_camera import PreferredCameraStreams
from server.service.streaming.presence import PresenceLog, ScopedPicture
from server.service.streaming.spliced_stream import GopAssembler, SplicedStream
from server.service.view_selection.decider import GopDecision
from server.service.view_selection.delay_modes import ModeDecision

_LATE_S = 2
"""How far a camera's stream may be behind the decisions before it is filled: pictures may still arrive."""


class Splicer:
    """Publishes all live streams; it cuts between cameras by choosing fragments, without decoding.

    Viewers with access to one person alone have separate streams (``scoped``), which turn gray when no camera
    has seen that person for a while. Only a site with tokens has such streams.
    """

    def __init__(
        self,
        frame_buffers: Mapping[str, FrameBuffer],
        stream_format: StreamFormat,
        config: Config,
        audio_buffer: AudioBuffer | None = None,
    ) -> None:
        self._frame_buffers, self._stream_format, self._config = frame_buffers, stream_format, config
        self._audio_buffer = audio_buffer
        site, http = config.site, config.http
        self.layout = segment_layout(site.fps, config.gop, http.hls_segment_s, http.hls_window_s)
        self._live = {camera: self._picture_stream() for camera in frame_buffers}
        self._decided = {camera: self._stream() for camera in frame_buffers}
        """Each camera's stream, delayed like the best views."""
        self._presence = PresenceLog(round(config.access.hide_after_s * site.fps))
        self._has_scoped = config.access.tokens is not None
        self._persons = PersonStreams(self._stream)
        self._scoped = PersonStreams(self._stream, self._presence.picture_of)
        self.preferred = PreferredCameraStreams(self._stream)
        self.preferred_scoped = PreferredCameraStreams(self._stream, self._presence.picture_of)
        self.live_persons = LivePersonStreams(self._picture_stream, frame_buffers, site.fps)
        self._smooth = PersonStreams(self._stream)
        self._smooth_pictures: dict[int, ScopedPicture] = {}
        """By person, what the GOP that is shown smoothly may show of them."""
        self._smooth_scoped = PersonStreams(
            self._stream, lambda number: self._smooth_pictures.get(number, ScopedPicture.GRAY)
        )
        self._decided_pictures: dict[int, dict[int, ScopedPicture]] = {}
        """The same by GOP, of those that are yet to be shown smoothly."""
        self._gops = self._smooth_gops = 0
        self.persons = self._persons.broadcasters
        self.scoped_persons = self._scoped.broadcasters
        self.cameras = {camera: stream.broadcaster for camera, stream in self._live.items()}
        self.decided_cameras = {camera: stream.broadcaster for camera, stream in self._decided.items()}

    def publish_frame(self, camera: str, frame: EncodedPicture) -> None:
        """Publish a camera's frame in the live stream of that camera."""
        self._live[camera].push(frame)
        self.live_persons.arrived()

    def publish_decision(self, decision: GopDecision) -> None:
        """Publish a decided GOP in the streams of all persons and cameras."""
        fps = self._config.site.fps
        gop = GopAssembler(
            self._frame_buffers, decision.first, decision.frames, fps, self._gops, self._audio_buffer
        )
        self._gops += 1
        cameras = {choice.number: choice.camera for choice in decision.choices}
        self._persons.show(cameras, decision.merged, gop)
        if self._has_scoped:
            self._presence.update(decision)
            self._scoped.show(cameras, decision.merged, gop)
            self._decided_pictures[decision.first] = {
                number: self._presence.picture_of(number) for number in cameras
            }
        for camera, stream in self._decided.items():
            stream.show(camera, gop)
        self.preferred.show(decision, gop)
        self.preferred_scoped.show(decision, gop)
        for live in self._live.values():
            live.fill(decision.first - round(_LATE_S * fps))
        ended = decision.first - 2 * self.layout.playlist_length * self.layout.segment_frames
        for streams in self._of_persons:
            streams.forget_ended_before(ended)

    def publish_live(self, decision: ModeDecision, merged: Mapping[int, int]) -> None:
        """Continue the streams without look-ahead with the cameras of the next GOP."""
        self.live_persons.decide(decision, merged)

    def publish_smooth(self, decision: ModeDecision, merged: Mapping[int, int]) -> None:
        """Publish a GOP in the streams with the longer look-ahead."""
        fps = self._config.site.fps
        gop = GopAssembler(
            self._frame_buffers,
            decision.first,
            decision.frames,
            fps,
            self._smooth_gops,
            self._audio_buffer,
        )
        self._smooth_gops += 1
        self._smooth.show(decision.cameras, merged, gop)
        if self._has_scoped:
            self._smooth_pictures = self._decided_pictures.pop(decision.first, {})
            self._decided_pictures = {
                first: pictures
                for first, pictures in self._decided_pictures.items()
                if first > decision.first
            }
            self._smooth_scoped.show(decision.cameras, merged, gop)

    def forget(self, known: Collection[int], merged: Collection[int]) -> None:
        """End the streams of persons that are no longer known, and of numbers that were merged into others.

        The latter continue while they are watched; a later viewer receives the stream of the kept number.
        """
        watched = {number for number in merged if self.viewers_of(number)}
        for streams in self._of_persons:
            streams.forget({*known, *watched})
        self.live_persons.forget({*known, *merged})
        self._presence.forget({*known, *watched})
        for preferred in (self.preferred, self.preferred_scoped):
            preferred.forget({*known, *merged})

    def viewers_of(self, number: int) -> int:
        """Return the number of viewers of a person's stream."""
        others = sum(streams.viewers_of(number) for streams in self._of_persons)
        return others + self.live_persons.viewers_of(number)

    def smooth_person(self, number: int, *, scoped_to_person: bool) -> Broadcaster:
        """Return a known person's stream with the longer look-ahead, even before its first GOP."""
        return (self._smooth_scoped if scoped_to_person else self._smooth).begin(number)

    def segmenter_of_person(
        self, number: int, *, scoped_to_person: bool = False, is_smooth: bool = False
    ) -> HlsSegmenter | None:
        """Return the newest segments of a person's stream, for a while even when it has ended."""
        if is_smooth:
            return (self._smooth_scoped if scoped_to_person else self._smooth).segmenter(number)
        return (self._scoped if scoped_to_person else self._persons).segmenter(number)

    def segmenter_of_camera(self, camera: str) -> HlsSegmenter | None:
        """Return the newest segments of a camera's stream."""
        stream = self._decided.get(camera)
        return None if stream is None else stream.segmenter

    def _broadcaster(self) -> Broadcaster:
        return Broadcaster(queue_gops=self._config.http.viewer_queue_gops)

    def _timeline(self) -> GaplessTimeline:
        return GaplessTimeline(self._stream_format, self._config.site.fps, self._config.gop)

    def _picture_stream(self) -> PictureStream:
        return PictureStream(self._broadcaster(), self._timeline(), self._config.site.fps, self._audio_buffer)

    @property
    def _of_persons(self) -> tuple[PersonStreams, ...]:
        return self._persons, self._scoped, self._smooth, self._smooth_scoped

    def _stream(self) -> SplicedStream:
        return SplicedStream(self._broadcaster(), self._timeline(), HlsSegmenter(self.layout))

    @property
    def person_viewers(self) -> int:
        """The number of viewers of best views in which no camera is preferred."""
        return sum(streams.viewers for streams in self._of_persons) + self.live_persons.viewers

    @property
    def preferred_camera_viewers(self) -> int:
        """The number of viewers of best views in which a camera is preferred."""
        return self.preferred.viewers + self.preferred_scoped.viewers

    @property
    def viewers(self) -> int:
        """The number of viewers of all streams."""
        broadcasters = [*self.cameras.values(), *self.decided_cameras.values()]
        camera_viewers = sum(broadcaster.viewers for broadcaster in broadcasters)
        return camera_viewers + self.person_viewers + self.preferred_camera_viewers

    def close(self) -> None:
        """End all streams."""
        for streams in self._of_persons:
            streams.close()
        for other in (self.preferred, self.preferred_scoped, self.live_persons):
            other.close()
        for stream in self._decided.values():
            stream.close()
        for broadcaster in self.cameras.values():
            broadcaster.close()
