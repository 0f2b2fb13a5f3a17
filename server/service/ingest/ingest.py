"""Ingest of the cameras' messages: frames to buffers, tracks to the epoch aligner, status to the page."""

from __future__ import annotations

import logging
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import msgspec

from camsync.lines import RateLimit
from logthrottle import LogThrottle
from server.media.picture import EncodedPicture
from server.media.stream_format import ParameterMismatchError
from server.messaging.camera_status import (
    CONDITION_TEXTS,
    SUBSTREAM_AWAY,
    CameraStatus,
    UnavailableCamera,
    picture_text,
)
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import (
    DECODE_ERRORS,
    AudioHeader,
    CameraTracks,
    FrameHeader,
    ThumbnailHeader,
    camera_of_key,
)
from server.service.ingest.camera_state import CameraState, Unavailability
from server.service.ingest.epoch_aligner import EpochAligner
from server.service.ingest.validation import is_plausible
from server.service.metrics.camera_metrics import CameraMetrics
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.frame_buffer import DamagedFrameError, FrameBuffer

log = logging.getLogger(__name__)

_MAX_THUMBNAILS = 300
"""Thumbnails kept of one camera: one for each recent track."""
_PRESENCE_LOG_BURST, _PRESENCE_LOG_RATE = 10, 1 / 30
"""Log lines about a camera that connects or disconnects: burst, and rate per second; it may flap."""
_THUMBNAIL_BYTES_MAX = 1 << 17
"""Larger than any thumbnail of 160 lines."""


@dataclass(frozen=True, slots=True)
class Thumbnail:
    """A JPEG thumbnail of a person."""

    jpeg: bytes
    pulse: int


class Ingest:
    """Receives the cameras' messages; invalid ones are counted and dropped.

    Args:
        frame_buffers: by camera.
        aligner: receives the tracks, and which cameras are connected.
        on_frame: called with each frame of a camera.
        audio_buffer: receives the site's audio; None if there is none.
        audio_sender: the camera that sends the audio.
        current_pulse: returns the newest pulse; below 0: unknown.
        on_ended: called with a camera and its boot when its last tracks have been received.
        max_ahead: pulses by which a message may be ahead of it. A later one is dropped: the aligner would
            wait until then.
    """

    def __init__(
        self,
        frame_buffers: Mapping[str, FrameBuffer],
        aligner: EpochAligner,
        on_frame: Callable[[str, EncodedPicture], None],
        audio_buffer: AudioBuffer | None = None,
        *,
        audio_sender: str | None = None,
        current_pulse: Callable[[], int] = lambda: -1,
        max_ahead: int = 0,
        on_ended: Callable[[str, int], None] = lambda _, __: None,
    ) -> None:
        self._current_pulse, self._max_ahead = current_pulse, max_ahead
        self._frame_buffers, self._aligner, self._on_frame = frame_buffers, aligner, on_frame
        self._on_ended = on_ended
        self._audio_buffer, self._audio_camera = audio_buffer, audio_sender
        self._unknown_log = LogThrottle()
        self._presence_log_limits = {
            camera: RateLimit(_PRESENCE_LOG_BURST, _PRESENCE_LOG_RATE, time.monotonic())
            for camera in frame_buffers
        }
        self.states = {
            camera: CameraState(CameraMetrics(frame_buffer.fps))
            for camera, frame_buffer in frame_buffers.items()
        }
        self._thumbnails: dict[str, OrderedDict[tuple[int, int], Thumbnail]] = {
            camera: OrderedDict() for camera in frame_buffers
        }
        """By camera, boot and track; the newest is the last."""
        self._frame_header = msgspec.msgpack.Decoder(FrameHeader)
        self._camera_tracks = msgspec.msgpack.Decoder(CameraTracks)
        self._camera_status = msgspec.msgpack.Decoder(CameraStatus)
        self._unavailable_camera = msgspec.msgpack.Decoder(UnavailableCamera)
        self._audio_header = msgspec.msgpack.Decoder(AudioHeader)
        self._thumbnail_header = msgspec.msgpack.Decoder(ThumbnailHeader)

    @property
    def handlers(self) -> dict[str, Callable[[Message], None]]:
        """What receives a camera's messages by topic, but for those that others receive, too."""
        return {
            "video": self.receive_video,
            "status": self.receive_status,
            "unavailable": self.receive_unavailable,
            "thumbs/*": self.receive_thumbnail,
        }

    def set_present(self, key: str, is_present: bool) -> None:
        """Record whether a camera is present, by its liveliness token."""
        camera = camera_of_key(key)
        state = self.states.get(camera)
        if state is None:
            if (more := self._unknown_log.record(camera)) is not None:
                log.warning("camera %s is not in the configuration%s: ignored", camera, more)
            return
        if is_present or state.alive:
            state.unavailable = None
        state.alive = is_present
        state.status = None  # of an earlier connection
        state.metrics.reset_recent()
        if is_present:
            state.refused, state.ended = "", False
            self._aligner.camera_connected(camera)
        else:
            state.metrics.record_problem("its process disconnected")
            self._aligner.camera_disconnected(camera)
            self._thumbnails[camera].clear()
        if self._presence_log_limits[camera].take(time.monotonic()):
            log.info("camera %s %s", camera, "connected" if is_present else "disconnected")

    def receive_video(self, message: Message) -> None:
        """Buffer and publish a frame."""
        state, camera = self._state_of(message)
        if state is None:
            return
        try:
            head = self._frame_header.decode(message.attachment)
            if state.refused or self._is_far_ahead(state, head.pulse):
                return
            frame_buffer = self._frame_buffers[camera]
            frame = frame_buffer.put(
                head.pulse, head.boot, message.payload, key=head.key, reference_pulse=head.reference_pulse
            )
        except (*DECODE_ERRORS, DamagedFrameError) as error:
            state.count_bad_message(error)
        except ParameterMismatchError as error:
            state.refused = f"{error}; do all cameras of this site run with the same configuration?"
            state.metrics.record_problem(state.refused)
            log.error("camera %s is refused: %s", camera, state.refused)  # noqa: TRY400 — a traceback adds nothing
        else:
            state.frames += 1
            state.metrics.measure_frame(head)
            self._aligner.frame_received(camera, head.boot, head.pulse)
            self._on_frame(camera, frame)

    def receive_audio(self, message: Message) -> None:
        """Buffer some of the site's audio."""
        if self._audio_buffer is None or self._audio_camera is None:
            return
        try:
            self._audio_buffer.put(self._audio_header.decode(message.attachment), message.payload)
        except (*DECODE_ERRORS, ValueError) as error:
            self.states[self._audio_camera].count_bad_message(f"audio: {error}")

    def receive_tracks(self, message: Message) -> None:
        """Pass a window's tracks to the aligner."""
        state, camera = self._state_of(message)
        if state is None:
            return
        try:
            tracks = self._camera_tracks.decode(message.payload)
        except DECODE_ERRORS as error:
            state.count_bad_message(error)
            return
        if tracks.camera != camera or not is_plausible(tracks, self._aligner.stride):
            state.count_bad_message("its tracks are inconsistent; does it run with this configuration?")
            return
        if self._is_far_ahead(state, end_of_epoch(tracks.epoch, self._aligner.stride)):
            return
        state.metrics.measure_window(tracks)
        state.ended = tracks.ended
        self._aligner.add_tracks(tracks)
        if tracks.ended:
            self._on_ended(camera, tracks.boot)

    def receive_retained_identities(self, message: Message, handler: Callable[[Message], None]) -> None:
        """Pass the identities that a camera has retained to a handler, which may raise a decode error."""
        state, _ = self._state_of(message)
        if state is None:
            return
        try:
            handler(message)
        except DECODE_ERRORS as error:
            state.count_bad_message(error)

    def receive_status(self, message: Message) -> None:
        """Record a camera's status."""
        state, _ = self._state_of(message)
        if state is None:
            return
        try:
            status = self._camera_status.decode(message.payload)
        except DECODE_ERRORS as error:
            state.count_bad_message(error)
        else:
            before = state.status
            was_covered = before is not None and before.covered_share > 0.0
            before_problem = state.operator_message if state.is_source_away else ""
            state.status = status
            told = status.unavailable if state.is_source_away else None
            state.unavailable = Unavailability.told(told, state.unavailable) if told else None
            if state.is_source_away:
                if state.operator_message != before_problem:
                    state.metrics.record_problem(state.operator_message)
            elif status.substream == "away" and (before is None or before.substream != "away"):
                state.metrics.record_problem(SUBSTREAM_AWAY)
            elif status.condition not in {"clear", "clear" if before is None else before.condition}:
                state.metrics.record_problem(CONDITION_TEXTS[status.condition])
            elif status.condition == "clear" and status.covered_share and not was_covered:
                state.metrics.record_problem(picture_text("clear", status.covered_share))

    def receive_unavailable(self, message: Message) -> None:
        """Record why a camera that is not connected cannot use its source, and when it opens it again."""
        state, _ = self._state_of(message)
        if state is None:
            return
        try:
            told = self._unavailable_camera.decode(message.payload)
        except DECODE_ERRORS as error:
            state.count_bad_message(error)
            return
        if state.alive:
            return  # it was late
        before = state.unavailable
        state.unavailable = Unavailability.told(told, before)
        if before is None or before.reason != state.unavailable.reason:
            state.metrics.record_problem(state.unavailable.reason)
            state.stream_changes += told.cause == "changed"

    def receive_thumbnail(self, message: Message) -> None:
        """Keep the newest thumbnail of a track."""
        state, camera = self._state_of(message)
        if state is None:
            return
        try:
            head = self._thumbnail_header.decode(message.attachment)
        except DECODE_ERRORS as error:
            state.count_bad_message(error)
            return
        if len(message.payload) > _THUMBNAIL_BYTES_MAX:
            state.count_bad_message(f"a thumbnail of {len(message.payload)} bytes")
            return
        if self._is_far_ahead(state, head.pulse):
            return
        thumbnails = self._thumbnails[camera]
        thumbnails[head.boot, head.track] = Thumbnail(message.payload, head.pulse)
        thumbnails.move_to_end((head.boot, head.track))
        if len(thumbnails) > _MAX_THUMBNAILS:
            thumbnails.popitem(last=False)

    @property
    def thumbnails(self) -> dict[tuple[str, int, int], Thumbnail]:
        """All thumbnails, by camera, boot and track."""
        return {
            (camera, boot, track): thumbnail
            for camera, thumbnails in self._thumbnails.items()
            for (boot, track), thumbnail in thumbnails.items()
        }

    def forget_thumbnails_before(self, pulse: int) -> None:
        """Drop the thumbnails of frames before a pulse."""
        for thumbnails in self._thumbnails.values():
            for key in [key for key, thumbnail in thumbnails.items() if thumbnail.pulse < pulse]:
                del thumbnails[key]

    def forget_thumbnails(self, tracks: Iterable[tuple[str, int, int]]) -> None:
        """Drop the thumbnails of tracks: camera, boot and track."""
        for camera, boot, track in tracks:
            if camera in self._thumbnails:
                self._thumbnails[camera].pop((boot, track), None)

    def _is_far_ahead(self, state: CameraState, pulse: int) -> bool:
        """Return whether a pulse is too far in the future to be real; if so, count a bad message."""
        newest = self._current_pulse()
        if newest < 0 or pulse <= newest + self._max_ahead:
            return False
        state.count_bad_message(f"pulse {pulse}, while the site is at pulse {newest}")
        return True

    def _state_of(self, message: Message) -> tuple[CameraState | None, str]:
        camera = camera_of_key(message.key)
        return self.states.get(camera), camera
