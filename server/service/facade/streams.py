"""Live streams: the best view of a person and each camera, as broadcasters and as HLS segments."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec

from server.service.pipeline import BestViewPipeline
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.hls_segmenter import HlsPart, HlsSegment, HlsSegmenter, SegmentLayout
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.subscriber_queue import BytesChunk, Chunk, Subscriber
from server.service.view_selection.delay_modes import DelayMode

__all__ = [
    "Broadcaster",
    "BytesChunk",
    "Chunk",
    "ConnectedViewers",
    "DelayMode",
    "HlsPart",
    "HlsSegment",
    "HlsSegmenter",
    "MediaChunk",
    "SegmentLayout",
    "StreamService",
    "Subscriber",
    "ViewerDelay",
]


@dataclass(frozen=True, slots=True)
class ConnectedViewers:
    """How many streams are watched over a connection of their own, by kind; HLS viewers are not in it."""

    object: int
    camera: int
    preferred: int

    @property
    def total(self) -> int:
        """All kinds together."""
        return self.object + self.camera + self.preferred


class ViewerDelay(msgspec.Struct, frozen=True):
    """A delay that viewers may choose, as measured in the last minutes."""

    delay: str
    """live, balanced or smooth, as in ?delay=."""
    lookahead_s: float
    """Seconds of look-ahead of its view selection."""
    delay_s: float | None
    """Median of the seconds from when a frame was due until it is sent; null: not measured yet."""
    delay_p95_s: float | None
    """The 95th percentile of that."""
    regret_s: float | None
    """Cost beyond the best views in hindsight: seconds of not seeing the person, per minute of a person."""
    cuts_per_minute: float | None
    """Cuts in a person's stream."""


class StreamService:
    """Queries about live streams."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._pipeline, self._splicer = pipeline, pipeline.splicer

    @property
    def codec(self) -> str | None:
        """RFC 6381 codec string of every stream's video; None before the first keyframe."""
        return self._pipeline.stream_format.codec

    @property
    def container(self) -> str:
        """The container of every stream, mp4 or webm, which follows from the codec."""
        return self._pipeline.stream_format.container

    @property
    def audio_codec(self) -> str | None:
        """RFC 6381 codec string of the site's audio; None: it has none."""
        audio = self._pipeline.config.sound.format
        return None if audio is None else audio.codec

    def init_segment(self) -> bytes | None:
        """Return the MP4 init segment that all streams share; None before the first keyframe."""
        config = self._pipeline.config
        return self._pipeline.stream_format.init_segment(
            config.site.size, config.site.fps, config.sound.format
        )

    def webm_header(self) -> bytes | None:
        """Return the header of all WebM streams of a VP8 site; None before the first keyframe."""
        site = self._pipeline.config.site
        return self._pipeline.stream_format.init_segment(site.size, site.fps)

    @property
    def segment_plan(self) -> SegmentLayout:
        """How streams are cut into HLS segments."""
        return self._splicer.layout

    def of_person(
        self, number: int, *, scoped_to_person: bool, delay: DelayMode = DelayMode.BALANCED
    ) -> Broadcaster | None:
        """Return the best view of a person, by their current number; None: there is none.

        The caller subscribes to it at once. A live one is never scoped.

        ``scoped_to_person``: frozen, then gray, while no camera sees the person; for viewers with access to
        that person alone.
        """
        streams = self._splicer.scoped_persons if scoped_to_person else self._splicer.persons
        if number not in streams or delay is DelayMode.BALANCED:
            return streams.get(number)
        if delay is DelayMode.SMOOTH:
            return self._splicer.smooth_person(number, scoped_to_person=scoped_to_person)
        return self._splicer.live_persons.broadcaster(number)

    def of_person_preferring(self, number: int, camera: str, *, scoped_to_person: bool) -> Broadcaster:
        """Return the best view of a person that stays with a camera for as long as it sees them."""
        preferring = self._splicer.preferred_scoped if scoped_to_person else self._splicer.preferred
        return preferring.broadcaster(number, camera)

    def of_camera(self, camera: str) -> Broadcaster:
        """Return a camera's stream as its frames arrive."""
        return self._splicer.cameras[camera]

    def of_camera_decided(self, camera: str) -> Broadcaster:
        """Return a camera's stream as late as a best view, in whole GOPs."""
        return self._splicer.decided_cameras[camera]

    def segments_of_person(
        self, number: int, *, scoped_to_person: bool, is_smooth: bool = False
    ) -> HlsSegmenter | None:
        """Return the newest HLS segments of a person's stream, for a while even when it has ended."""
        return self._splicer.segmenter_of_person(
            number, scoped_to_person=scoped_to_person, is_smooth=is_smooth
        )

    def segments_of_camera(self, camera: str) -> HlsSegmenter | None:
        """Return the newest HLS segments of a camera; None: there is no such camera."""
        return self._splicer.segmenter_of_camera(camera)

    def connected_viewers_of_person(self, number: int) -> int:
        """Return how many watch a person's best view over a connection of their own, scoped or not."""
        return self._splicer.viewers_of(number)

    def delays(self) -> list[ViewerDelay]:
        """Return the delays that viewers may choose, each as it is measured now."""
        pipeline, fps = self._pipeline, self._pipeline.config.site.fps
        balanced = pipeline.config.lookahead_of(pipeline.decider.view)
        longer = balanced + pipeline.decider.modes.smooth_lookahead * pipeline.config.gop
        lookahead = {DelayMode.LIVE: 0, DelayMode.BALANCED: balanced, DelayMode.SMOOTH: longer}
        return [self._delay(mode, lookahead[mode] / fps) for mode in DelayMode]

    def _delay(self, mode: DelayMode, lookahead_s: float) -> ViewerDelay:
        measured = self._pipeline.mode_publisher.meter.delay(mode)
        score = self._pipeline.decider.modes.score(mode)
        return ViewerDelay(
            delay=mode.value,
            lookahead_s=lookahead_s,
            delay_s=None if measured is None else round(measured.median, 2),
            delay_p95_s=None if measured is None else round(measured.p95, 2),
            regret_s=None if score is None else round(score.regret_s, 2),
            cuts_per_minute=None if score is None else round(score.cuts_per_minute, 1),
        )

    @property
    def connected_viewers(self) -> ConnectedViewers:
        """How many streams are watched over a connection of their own."""
        splicer = self._splicer
        cameras = sum(
            broadcaster.viewers
            for broadcaster in (*splicer.cameras.values(), *splicer.decided_cameras.values())
        )
        return ConnectedViewers(splicer.person_viewers, cameras, splicer.preferred_camera_viewers)

    def close(self) -> None:
        """End all streams."""
        self._splicer.close()
