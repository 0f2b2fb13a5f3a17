"""Streams of whole GOPs, each from one camera: cut from camera to camera without decoding."""

from __future__ import annotations

from collections.abc import Mapping

from server.media.containers.mpegts import ContinuityCounters
from server.media.parameter_sets import ParameterSets
from server.media.picture import EncodedPicture
from server.media.stream_format import StreamFormat
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.gapless_timeline import GaplessTimeline
from server.service.streaming.hls_segmenter import HlsSegmenter
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.presence import ScopedPicture


class GopAssembler:
    """Builds chunks of one GOP, the frames ``first … first + frames - 1`` of any camera.

    A complete GOP becomes one chunk that all streams share. ``tables`` counts GOPs for MPEG-TS.
    """

    def __init__(
        self,
        frame_buffers: Mapping[str, FrameBuffer],
        first: int,
        frames: int,
        fps: float,
        tables: int,
        audio_buffer: AudioBuffer | None = None,
    ) -> None:
        self._audio_buffer = audio_buffer
        self._audio = None if audio_buffer is None else audio_buffer.audio_between(first, first + frames)
        self.first, self.until = first, first + frames
        self._frame_buffers, self._fps, self._tables = frame_buffers, fps, tables
        self._complete: dict[str, MediaChunk | None] = {}
        self._gray: dict[ParameterSets | None, MediaChunk | None] = {}

    def pictures(self, camera: str) -> list[EncodedPicture]:
        """Return the pictures of a camera that have arrived."""
        return self._frame_buffers[camera].pictures(self.first, self.until - self.first)

    def complete_chunk(self, camera: str) -> MediaChunk | None:
        """Return a camera's GOP as a shared chunk; None if a picture is missing."""
        if camera not in self._complete:
            pictures = self.pictures(camera)
            is_complete = len(pictures) == self.until - self.first and pictures[0].key
            self._complete[camera] = self.chunk(pictures) if is_complete else None
        return self._complete[camera]

    def gray_chunk(self, stream_format: StreamFormat, newest: EncodedPicture | None) -> MediaChunk | None:
        """Return a gray GOP that can follow a picture, shared by all streams of its parameter sets.

        None: this format has no gray picture.
        """
        parameters = None if newest is None else newest.parameters
        if parameters not in self._gray:
            pictures = stream_format.blank(newest, self.first, self.until - self.first, self._fps)
            self._gray[parameters] = self.chunk(pictures, is_muted=True) if pictures else None
        return self._gray[parameters]

    def chunk(self, pictures: list[EncodedPicture], *, is_muted: bool = False) -> MediaChunk:
        """Return pictures of this GOP as a chunk, with the site's audio or, if muted, with silence."""
        first, until = pictures[0].pulse, pictures[-1].until
        audio = self._audio  # of the whole GOP, shared by all streams
        if self._audio_buffer is not None and (first, until) != (self.first, self.until):
            audio = self._audio_buffer.audio_between(first, until)
        if is_muted and audio is not None:
            audio = audio.silenced
        is_filler, counters = not pictures[0].key, ContinuityCounters(self._tables)
        return MediaChunk(pictures, self._fps, counters, is_filler=is_filler, audio=audio, is_muted=is_muted)


class GopSequencer:
    """Turns one camera choice per GOP into the chunks of one stream, without a gap in its time."""

    def __init__(self, timeline: GaplessTimeline) -> None:
        self._timeline = timeline
        self._camera: str | None = None

    def show(self, camera: str | None, gop: GopAssembler) -> list[MediaChunk]:
        """Return a camera's GOP, with filler for missing pictures; None: continue with the last camera."""
        before = self._timeline.fill(gop.first)
        chunks = [gop.chunk(before)] if before else []
        complete = None if camera is None else gop.complete_chunk(camera)
        self._camera = camera or self._camera
        if complete is not None:
            self._timeline.record_shown(complete.pictures[-1])
            return [*chunks, complete]
        arrived = [] if self._camera is None else gop.pictures(self._camera)
        pictures = [shown for picture in arrived for shown in self._timeline.push(picture)]
        pictures += self._timeline.fill(gop.until)
        return [*chunks, gop.chunk(pictures)] if pictures else chunks

    def freeze(self, gop: GopAssembler) -> list[MediaChunk]:
        """Return a GOP that repeats the last picture, muted; a gray GOP if there is none to repeat."""
        self._camera = None  # its late pictures must not be shown any more
        before, frozen = self._timeline.fill(gop.first), self._timeline.fill(gop.until)
        chunks = [gop.chunk(pictures, is_muted=True) for pictures in (before, frozen) if pictures]
        return chunks if frozen else [*chunks, *self.gray_out(gop)]

    def gray_out(self, gop: GopAssembler) -> list[MediaChunk]:
        """Return a gray GOP, muted, after the filler of a gap before it."""
        self._camera = None
        before = self._timeline.fill(gop.first)
        chunks = [gop.chunk(before, is_muted=True)] if before else []
        gray = gop.gray_chunk(self._timeline.stream_format, self._timeline.newest)
        if gray is None:
            return chunks
        self._timeline.record_shown(gray.pictures[-1])
        return [*chunks, gray]


class SplicedStream:
    """A published stream of whole GOPs; ``segmenter`` keeps the newest of them for HLS."""

    def __init__(self, broadcaster: Broadcaster, timeline: GaplessTimeline, segmenter: HlsSegmenter) -> None:
        self.broadcaster, self.segmenter = broadcaster, segmenter
        self._sequencer = GopSequencer(timeline)

    def show(
        self, camera: str | None, gop: GopAssembler, picture: ScopedPicture = ScopedPicture.SHOWN
    ) -> None:
        """Publish a camera's GOP, filled where pictures are missing.

        ``picture``: instead of the GOP, the last picture may stand, or gray be shown.
        """
        match picture:
            case ScopedPicture.SHOWN:
                chunks = self._sequencer.show(camera, gop)
            case ScopedPicture.FROZEN:
                chunks = self._sequencer.freeze(gop)
            case ScopedPicture.GRAY:
                chunks = self._sequencer.gray_out(gop)
        for chunk in chunks:
            self.segmenter.put(chunk)
            self.broadcaster.publish(chunk)

    def close(self) -> None:
        """End the stream."""
        self.segmenter.end()
        self.broadcaster.close()
