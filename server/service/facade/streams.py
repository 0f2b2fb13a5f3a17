"""Live streams: the best view of a person and each camera, as broadcasters and as HLS segments."""

from __future__ import annotations

from dataclasses import dataclass

from server.service.pipeline import BestViewPipeline
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.hls_segmenter import HlsPart, HlsSegment, HlsSegmenter, SegmentLayout
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.subscriber_queue import BytesChunk, Chunk, Subscriber

__all__ = [
    "Broadcaster",
    "BytesChunk",
    "Chunk",
    "ConnectedViewers",
    "HlsPart",
    "HlsSegment",
    "HlsSegmenter",
    "MediaChunk",
    "SegmentLayout",
    "StreamService",
    "Subscriber",
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

    def of_person(self, number: int, *, scoped_to_person: bool) -> Broadcaster | None:
        """Return the best view of a person, by their current number; None: there is none.

        ``scoped_to_person``: frozen, then gray, while no camera sees the person; for viewers with access to
        that person alone.
        """
        return (self._splicer.scoped_persons if scoped_to_person else self._splicer.persons).get(number)

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

    def segments_of_person(self, number: int, *, scoped_to_person: bool) -> HlsSegmenter | None:
        """Return the newest HLS segments of a person's stream, for a while even when it has ended."""
        return self._splicer.segmenter_of_person(number, scoped_to_person=scoped_to_person)

    def segments_of_camera(self, camera: str) -> HlsSegmenter | None:
        """Return the newest HLS segments of a camera; None: there is no such camera."""
        return self._splicer.segmenter_of_camera(camera)

    def connected_viewers_of_person(self, number: int) -> int:
        """Return how many watch a person's best view over a connection of their own, scoped or not."""
        return self._splicer.viewers_of(number)

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
