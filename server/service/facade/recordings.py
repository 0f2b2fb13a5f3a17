"""Recordings: recorded streams, played from a point in time, and the decisions of that time."""

from __future__ import annotations

import logging
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Sequence
from dataclasses import dataclass

from server.messaging.epochs import utc_time_of_pulse
from server.service.facade.errors import UnknownCameraError
from server.service.pipeline import BestViewPipeline
from server.service.recording.media_files import run_in_reader_thread
from server.service.recording.segment_index import CameraRange, PulseRange
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.gapless_timeline import GaplessTimeline
from server.service.streaming.media_chunk import MediaChunk
from server.service.time_shift.availability import (
    available_camera_ranges,
    available_ranges,
    first_available,
    forget_missing,
    forget_missing_ends,
)
from server.service.time_shift.decision_log import read_decision_lines
from server.service.time_shift.hls_time_shift import SegmentList, TimeShift
from server.service.time_shift.playback import (
    CameraPlayback,
    PersonPlayback,
    PlaybackSource,
    SessionEntries,
    recorded_audio,
)
from server.service.time_shift.playback_audio import PlaybackAudio
from server.service.time_shift.presence_history import PresenceHistory
from server.service.time_shift.time_reference import (
    TimeReferenceError,
    parse_time_reference,
)
from server.service.time_shift.time_shift_stream import PlaybackRange, TimeShiftStream

log = logging.getLogger(__name__)

__all__ = [
    "PlaybackRange",
    "RecordedStream",
    "RecordingService",
    "RecordingStatus",
    "SegmentList",
    "TimeReferenceError",
    "TimeShift",
]


@dataclass(frozen=True, slots=True)
class RecordingStatus:
    """Whether streams are recorded to disk."""

    enabled: bool
    """Whether a folder is configured."""
    is_on: bool
    """Whether it is written to: recording can be switched off."""
    error: str
    """Why nothing is written at the moment; empty: it is, or recording is off."""


class RecordedStream:
    """One stream's recording, on disk and in memory. ``name`` is for messages, such as object 3."""

    def __init__(self, pipeline: BestViewPipeline, source: PlaybackSource, name: str) -> None:
        self._pipeline, self._source, self.name = pipeline, source, name

    @property
    def end(self) -> int:
        """The pulse after the newest frame."""
        return self._source.end

    def available_from(self, pulse: int) -> int | None:
        """Return the first recorded pulse from this one on; None: there is none."""
        return first_available(self._source, pulse)

    def spans(self, start: int, end: int) -> list[PulseRange]:
        """Return the recorded ranges without a gap of pulses ``start … end - 1``."""
        return available_ranges(self._source, start, end)

    def views(self, start: int, end: int) -> list[CameraRange]:
        """Return the recorded ranges of pulses ``start … end - 1`` by camera shown, in order."""
        return available_camera_ranges(self._source, start, end)

    async def forget_missing_ends(self, start: int, end: int | None = None) -> None:
        """Drop index entries whose files are missing at the two ends of a range.

        Raises:
            OSError: the disk cannot be read.
        """
        await run_in_reader_thread(forget_missing_ends, self._source, start, end)

    async def forget_missing(self, start: int, end: int) -> None:
        """Drop all index entries of pulses ``start … end - 1`` whose files are missing.

        Raises:
            OSError: the disk cannot be read.
        """
        await run_in_reader_thread(forget_missing, self._source, start, end)

    def play(
        self, playback: PlaybackRange, live: Callable[[], Broadcaster | None]
    ) -> AsyncGenerator[MediaChunk, None]:
        """Play GOP after GOP; ``live`` returns the stream to continue with at the present."""
        fps, audio = self._pipeline.config.site.fps, self._pipeline.recorder.audio_buffer
        playback_audio = (
            None if audio is None else PlaybackAudio(audio, self._recorded_audio, lambda: self.end)
        )
        stream = TimeShiftStream(self._source, self._timeline(), fps, live, playback_audio)
        return stream.send(playback)

    def time_shift(self, *, has_ended: bool) -> TimeShift:
        """Return the stream in HLS segments, numbered like live ones; ``has_ended``: nothing is added."""
        pipeline = self._pipeline
        return TimeShift(
            self._source,
            pipeline.splicer.layout,
            self._timeline,
            self._playback_audio,
            gop=pipeline.config.gop,
            decided=pipeline.recorder.recent.end,
            has_ended=has_ended,
        )

    def peak_bit_rate(self) -> float:
        """Return the most bits a second of video, by whole files on disk and GOPs in memory."""
        source = self._source
        rates = [
            8 * entry.length / entry.frames for recorded in source.recorded for entry in recorded.index.all
        ]
        gop = source.gop_in_memory_from(0)
        while gop is not None:
            rates.append(8 * sum(map(len, gop.fragments)) / len(gop.fragments))
            gop = source.gop_in_memory_from(gop.end)
        return self._pipeline.config.site.fps * max(rates, default=0.0)

    def _timeline(self) -> GaplessTimeline:
        config = self._pipeline.config
        return GaplessTimeline(self._pipeline.stream_format, config.site.fps, config.gop)

    def _playback_audio(self) -> PlaybackAudio | None:
        audio = self._pipeline.recorder.audio_buffer
        return None if audio is None else PlaybackAudio(audio, self._recorded_audio)

    def _recorded_audio(self) -> Sequence[SessionEntries]:
        return recorded_audio(self._pipeline.recorder)


class RecordingService:
    """Queries about recordings."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._pipeline, self._recorder = pipeline, pipeline.recorder

    @property
    def decided_end(self) -> int:
        """The pulse after the newest decided frame."""
        return self._recorder.recent.end

    @property
    def status(self) -> RecordingStatus:
        """Whether streams are recorded to disk."""
        writer = self._recorder.writer
        is_on = writer is not None and not self._recorder.is_paused
        return RecordingStatus(writer is not None, is_on, "" if writer is None else writer.problem)

    def switch(self, *, is_on: bool) -> None:
        """Switch recording to disk off or on; it is on when the service starts."""
        if self._recorder.is_paused is is_on:
            self._recorder.is_paused = not is_on
            log.info("recording is switched %s", "on" if is_on else "off")

    def of_person(self, number: int, *, scoped_to_person: bool) -> RecordedStream:
        """Return a person's recorded stream; ``scoped_to_person``: gray where no camera had seen them."""
        pipeline, recorder = self._pipeline, self._recorder
        current = pipeline.decision_state.resolve(number)
        numbers = (number,) if number == current else (current, number)
        presence = None
        if scoped_to_person:
            fps = pipeline.config.site.fps
            presence = PresenceHistory(
                recorder, numbers, round(pipeline.config.access.hide_after_s * fps), fps
            )
        return RecordedStream(pipeline, PersonPlayback(recorder, numbers, presence), f"object {number}")

    def of_camera(self, camera: str) -> RecordedStream:
        """Return a camera's recorded stream.

        Raises:
            UnknownCameraError: there is no such camera.
        """
        if camera not in self._pipeline.frame_buffers:
            raise UnknownCameraError(camera, self._pipeline.frame_buffers)
        return RecordedStream(self._pipeline, CameraPlayback(self._recorder, camera), f"camera {camera}")

    def decisions(self, start: int, end: int) -> AsyncIterator[bytes]:
        """Return the decisions about pulses ``start … end - 1``, each a line of JSON."""
        return read_decision_lines(self._recorder, start, end)

    def pulse_at(self, moment: str, now: int) -> int:
        """Return the pulse that a text names: ``-60`` (seconds before pulse ``now``), ``p1250`` or ISO 8601.

        Raises:
            TimeReferenceError: it names none.
        """
        return parse_time_reference(
            moment, now=now, fps=self._pipeline.config.site.fps, pulse0=self._pipeline.pulses.pulse0
        )

    def time_of(self, pulse: int) -> str | None:
        """Return when a pulse is due, UTC in ISO 8601; None before the first pulse."""
        return utc_time_of_pulse(pulse, self._pipeline.config.site.fps, self._pipeline.pulses.pulse0)

    @property
    def viewers(self) -> int:
        """The number of time-shifted viewers; those that have reached the present are not counted."""
        return self._recorder.viewers

    def viewer_joined(self) -> None:
        """Count a time-shifted viewer."""
        self._recorder.viewers += 1

    def viewer_left(self) -> None:
        """Stop counting a time-shifted viewer."""
        self._recorder.viewers -= 1
