"""Records every decided GOP: the newest in memory, all of them on the disk if configured."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Mapping

from server.config.site_config import Config
from server.media.containers.fmp4 import init_segment
from server.media.containers.mp4_audio import audio_init_segment
from server.media.parameter_sets import ParameterSets
from server.media.stream_format import StreamFormat
from server.messaging.messages import GopChoices
from server.service.recording.recent_gops import RecentGops
from server.service.recording.recording_folder import GopRecord, RecordingFolder
from server.service.recording.recording_session import RecordingSession
from server.service.recording.retention import RetentionLimits
from server.service.recording.session_files import InitSegments, RecordingSessionInfo
from server.service.recording.writer_thread import WriterThread
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.frame_buffer import FrameBuffer
from server.system.errors import UserError, reason_of
from server.system.private_files import mode_if_shared

log = logging.getLogger(__name__)

_PULSE0_TOLERANCE_S = 0.5
"""Pulse 0 may differ by so much between sessions of the same pulses, after a restart of the pulse server."""


class Recorder:
    """Records every decision, and finds recorded sessions. ``frames`` is the size of the frame buffers."""

    def __init__(
        self,
        config: Config,
        frame_buffers: Mapping[str, FrameBuffer],
        stream_format: StreamFormat,
        frames: int,
        audio_buffer: AudioBuffer | None = None,
    ) -> None:
        self._config, self._stream_format = config, stream_format
        self.audio_buffer = audio_buffer
        """The newest audio; None if the site has none."""
        self.recent = RecentGops(frame_buffers, config.gop, frames)
        self.pulse0: float | None = None
        self.person_numbers_since: float | None = None
        self._pending: deque[GopChoices] = deque()
        """Decided GOPs that wait for late frames."""
        self._max_late_frames = frames // 2
        self._init_of_parameters: tuple[ParameterSets, InitSegments] | None = None
        """The init segments of these parameters: cached, since every GOP that is played needs them."""
        self.is_paused = False
        """Whether nothing is written to the disk, on an operator's command."""
        self.viewers = 0
        """The number of viewers of time shift."""
        record = config.record
        self.folder: RecordingFolder | None = None
        self.writer: WriterThread | None = None
        if record.folder is not None:
            limits = RetentionLimits(record.keep_s, record.max_mb, record.segment_s, record.trust_clock)
            self.folder = folder = RecordingFolder(record.folder, limits)
            max_queued = max(4, frames // config.gop)  # no more than the frame buffers hold anyway
            self.writer = WriterThread(
                self._write, folder.abandon_segment, folder.close, max_queued, where=str(record.folder)
            )

    def open(self) -> None:
        """Start recording, if configured.

        Raises:
            UserError: the folder cannot be written, or another process records there.
        """
        if self.folder is None or self.writer is None:
            return
        try:
            self.folder.open()
        except BlockingIOError as error:
            raise UserError(f"record.folder: {self.folder.folder}: another process records there") from error
        except OSError as error:
            raise UserError(
                f"record.folder: {self.folder.folder}: cannot write there: {reason_of(error)}"
            ) from error
        self.writer.start()
        log.info("recording to %s", self.folder.folder)
        if mode := mode_if_shared(self.folder.folder):
            log.warning(
                "record.folder: %s has mode %s: others on this machine may see when it was recorded, "
                "not what; chmod 700 closes it",
                self.folder.folder,
                mode,
            )

    def put(
        self, choices: GopChoices, pulse0: float | None, person_numbers_since: float | None = None
    ) -> None:
        """Record a decision without blocking; the times are those of pulse 0 and the first person number."""
        self.pulse0, self.person_numbers_since = pulse0, person_numbers_since
        self.recent.put(choices)
        if self.writer is None:
            return
        if not self.is_paused:
            self._pending.append(choices)
        while self._pending and self._is_settled(self._pending[0]):
            self._queue_oldest(self.writer)

    def flush(self) -> None:
        """Queue all decided GOPs for the disk, with the frames that have arrived."""
        while self.writer is not None and self._pending:
            self._queue_oldest(self.writer)

    def close(self) -> None:
        """End the recording."""
        if self.writer is not None:
            self.flush()
            self.writer.close()

    def _is_settled(self, choices: GopChoices) -> bool:
        """Return whether no more frames are expected; a busy camera's may arrive after the decision."""
        end = choices.first + choices.frames
        if end <= self.recent.end - self._max_late_frames:
            return True
        newest = [self.recent.end_of_camera(camera) for camera in self._config.camera_ids]
        return all(pulse >= end or pulse < choices.first - self._max_late_frames for pulse in newest)

    def _queue_oldest(self, writer: WriterThread) -> None:
        choices = self._pending.popleft()
        arrived = {
            camera: self.recent.arrived_until_gap(camera, choices.first, choices.frames)
            for camera in self._config.camera_ids
        }
        cameras = {camera: gop for camera, gop in arrived.items() if gop is not None}
        end = choices.first + choices.frames
        audio = None if self.audio_buffer is None else self.audio_buffer.audio_between(choices.first, end)
        writer.put(GopRecord(choices, cameras, audio))

    @property
    def session(self) -> RecordingSession | None:
        """The session of this service; None if it has not recorded yet."""
        return None if self.folder is None else self.folder.session

    @property
    def compatible_sessions(self) -> list[RecordingSession]:
        """This session and the earlier ones of the same pulses and parameter sets, the oldest first."""
        if self.folder is None:
            return []
        current = [] if self.folder.session is None else [self.folder.session]
        init = self._init
        return [
            *(session for session in tuple(self.folder.earlier) if self._is_compatible(session, init)),
            *current,
        ]

    @property
    def sessions_with_same_persons(self) -> list[RecordingSession]:
        """Those of :attr:`compatible_sessions` in which person numbers mean the same persons as now."""
        return [
            session
            for session in self.compatible_sessions
            if session is self.session or self._has_same_persons(session)
        ]

    @property
    def sessions_with_same_audio(self) -> list[RecordingSession]:
        """Those of :attr:`compatible_sessions` with the audio format of this site."""
        init = self._init
        return (
            []
            if init is None
            else [session for session in self.compatible_sessions if session.init.audio == init.audio]
        )

    def _has_same_persons(self, session: RecordingSession) -> bool:
        return (
            self.person_numbers_since is not None
            and session.info.person_numbers_since == self.person_numbers_since
        )

    def _is_compatible(self, session: RecordingSession, init: InitSegments | None) -> bool:
        pulse0 = self.pulse0
        if init is None or pulse0 is None or session.info.pulse0 is None:
            return False
        same = (
            session.info.fps == self._config.site.fps
            and abs(session.info.pulse0 - pulse0) < _PULSE0_TOLERANCE_S
        )
        return same and session.init.video == init.video

    @property
    def _init(self) -> InitSegments | None:
        """The init segments of this service's files; None before the first keyframe."""
        parameters, site, audio = self._stream_format.parameters, self._config.site, self._config.sound.format
        if parameters is None:
            return None
        cached = self._init_of_parameters
        if cached is None or cached[0] != parameters:
            video = init_segment(parameters, site.width, site.height)
            cached = (
                parameters,
                InitSegments(video, b"" if audio is None else audio_init_segment(audio)),
            )
            self._init_of_parameters = cached
        return cached[1]

    def _write(self, record: GopRecord) -> None:
        """Write a GOP; called in the writer thread."""
        parameters, init, site = self._stream_format.parameters, self._init, self._config.site
        if self.folder is None or parameters is None or init is None:
            return
        info = RecordingSessionInfo(
            site=site.name,
            fps=site.fps,
            width=site.width,
            height=site.height,
            codec=parameters.codec,
            cameras=list(self._config.camera_ids),
            sound=None if self.audio_buffer is None else self.audio_buffer.format.codec,
            started=time.time(),
            pulse0=self.pulse0,
            person_numbers_since=self.person_numbers_since,
        )
        self.folder.write(record, info, init)
