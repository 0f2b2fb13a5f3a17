"""What the best-view service keeps of the past: a moment in memory, more on the disk where configured."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Mapping

from server.config.site_config import Config
from server.media.containers.fmp4 import init_segment
from server.media.containers.mp4_audio import audio_init_segment
from server.media.h264.annexb import ParameterSets
from server.media.stream_format import StreamFormat
from server.messaging.messages import GopChoices
from server.service.recording.recent_gops import RecentGops
from server.service.recording.recording_folder import GopRecord, RecordingFolder
from server.service.recording.recording_session import InitSegments, RecordingSession, SessionInfo
from server.service.recording.retention import RetentionLimits
from server.service.recording.writer_thread import WriterThread
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.frame_buffer import FrameBuffer
from server.system.errors import UserError
from server.system.private_files import rights_of_others

log = logging.getLogger(__name__)

_SAME_S = 0.5
"""Pulses whose numbers mean the same time but for so much are the same: the pulse server may be another."""


class Recorder:
    """Takes every decision over as it is made, and finds it again. ``frames`` is what the shelves keep."""

    def __init__(
        self,
        config: Config,
        frame_buffers: Mapping[str, FrameBuffer],
        agreement: StreamFormat,
        frames: int,
        sound: AudioBuffer | None = None,
    ) -> None:
        self._config, self._agreement = config, agreement
        self.sound = sound
        """The newest sound; None: the site has none."""
        self.recent = RecentGops(frame_buffers, config.encode.gop, frames)
        self.pulse0: float | None = None
        self.numbers_since: float | None = None
        self._held: deque[GopChoices] = deque()
        """Decided, but not all cameras' pictures have come."""
        self._patience = frames // 2
        self._begin: tuple[ParameterSets, InitSegments] | None = None
        """What this service's files begin with, made of these parameters: every GOP that is played asks."""
        self.viewers = 0
        """How many are watching the past."""
        record = config.record
        self.store: RecordingFolder | None = None
        self.writer: WriterThread | None = None
        if record.folder is not None:
            bounds = RetentionLimits(record.keep_s, record.most_mb, record.segment_s, record.trust_clock)
            self.store = store = RecordingFolder(record.folder, bounds)
            most = max(4, frames // config.encode.gop)  # no more than the shelves hold anyway
            self.writer = WriterThread(
                self._write, store.abandon, store.close, most, where=str(record.folder)
            )

    def open(self) -> None:
        """Begin to record, where that is configured.

        Raises:
            UserError: the folder cannot be written, or another process records there.
        """
        if self.store is None or self.writer is None:
            return
        try:
            self.store.open()
        except BlockingIOError as error:
            raise UserError(f"record.folder: {self.store.folder}: another process records there") from error
        except OSError as error:
            raise UserError(
                f"record.folder: {self.store.folder}: cannot write there: {error.strerror}"
            ) from error
        self.writer.start()
        log.info("recording to %s", self.store.folder)
        if mode := rights_of_others(self.store.folder):
            log.warning(
                "record.folder: %s has mode %s: others on this machine may see when it was recorded, "
                "not what; chmod 700 closes it",
                self.store.folder,
                mode,
            )

    def put(self, choices: GopChoices, pulse0: float | None, numbers_since: float | None = None) -> None:
        """Take a decision over, and since when pulses and people's numbers are these; never waits."""
        self.pulse0, self.numbers_since = pulse0, numbers_since
        self.recent.put(choices)
        if self.writer is None:
            return
        self._held.append(choices)
        while self._held and self._has_come(self._held[0]):
            self._hand_over(self.writer)

    def close(self) -> None:
        """End the recording."""
        if self.writer is not None:
            while self._held:
                self._hand_over(self.writer)
            self.writer.close()

    def _has_come(self, choices: GopChoices) -> bool:
        """Tell whether nothing is to be waited for: a busy camera's pictures may come after the decision."""
        end = choices.first + choices.frames
        if end <= self.recent.end - self._patience:
            return True
        newest = [self.recent.end_of_camera(camera) for camera in self._config.camera_ids]
        return all(it >= end or it < choices.first - self._patience for it in newest)

    def _hand_over(self, writer: WriterThread) -> None:
        choices = self._held.popleft()
        delivered = {
            camera: self.recent.delivered(camera, choices.first, choices.frames)
            for camera in self._config.camera_ids
        }
        cameras = {camera: gop for camera, gop in delivered.items() if gop is not None}
        end = choices.first + choices.frames
        heard = None if self.sound is None else self.sound.audio_between(choices.first, end)
        writer.put(GopRecord(choices, cameras, heard))

    @property
    def run(self) -> RecordingSession | None:
        """What this service has recorded; None: nothing."""
        return None if self.store is None else self.store.run

    @property
    def runs(self) -> list[RecordingSession]:
        """What this service and those before it have recorded by the same pulses and parameters."""
        if self.store is None:
            return []
        current = [] if self.store.run is None else [self.store.run]
        own = self._headers
        return [*(run for run in tuple(self.store.earlier) if self._fits(run, own)), *current]

    @property
    def numbered(self) -> list[RecordingSession]:
        """Those of them in which people's numbers are the same people's as now."""
        return [run for run in self.runs if run is self.run or self._same_people(run)]

    @property
    def sounding(self) -> list[RecordingSession]:
        """Those of them whose sound is that of this site."""
        own = self._headers
        return [] if own is None else [run for run in self.runs if run.headers.sound == own.sound]

    def _same_people(self, run: RecordingSession) -> bool:
        return self.numbers_since is not None and run.head.numbers_since == self.numbers_since

    def _fits(self, run: RecordingSession, own: InitSegments | None) -> bool:
        pulse0 = self.pulse0
        if own is None or pulse0 is None or run.head.pulse0 is None:
            return False
        same = run.head.fps == self._config.site.fps and abs(run.head.pulse0 - pulse0) < _SAME_S
        return same and run.headers.pictures == own.pictures

    @property
    def _headers(self) -> InitSegments | None:
        """What this service's files begin with; None: nobody knows yet."""
        parameters, site, sound = self._agreement.parameters, self._config.site, self._config.sound.format
        if parameters is None:
            return None
        begin = self._begin
        if begin is None or begin[0] != parameters:
            pictures = init_segment(parameters, site.width, site.height)
            begin = parameters, InitSegments(pictures, b"" if sound is None else audio_init_segment(sound))
            self._begin = begin
        return begin[1]

    def _write(self, piece: GopRecord) -> None:
        """Write a piece, in the writer's thread."""
        parameters, headers, site = self._agreement.parameters, self._headers, self._config.site
        if self.store is None or parameters is None or headers is None:
            return
        head = SessionInfo(
            site=site.name,
            fps=site.fps,
            width=site.width,
            height=site.height,
            codec=parameters.codec,
            cameras=list(self._config.camera_ids),
            sound=None if self.sound is None else self.sound.format.codec,
            began=time.time(),
            pulse0=self.pulse0,
            numbers_since=self.numbers_since,
        )
        self.store.write(piece, head, headers)
