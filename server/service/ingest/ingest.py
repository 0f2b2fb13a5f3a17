"""What comes from the cameras: frames onto the shelves, tracks to the aligner, states for the page."""

from __future__ import annotations

import logging
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import msgspec

from camsync.lines import RateLimit
from logthrottle import LogThrottle
from server.media.picture import EncodedPicture
from server.media.stream_format import ParameterMismatchError
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import (
    DECODE_ERRORS,
    AudioHeader,
    CameraStatus,
    CameraTracks,
    FrameHeader,
    ThumbnailHeader,
    camera_of_key,
)
from server.service.ingest.epoch_aligner import EpochAligner
from server.service.ingest.validation import is_plausible
from server.service.metrics.camera_metrics import CameraMetrics
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.frame_buffer import FrameBuffer, UndecodableFrameError

log = logging.getLogger(__name__)

_THUMBNAILS_MOST = 300
"""Small pictures of one camera that are kept; there are as many as tracks were seen lately."""
_TOLD_MOST, _TOLD_RATE = 10, 1 / 30
"""Lines of the log that say that a camera has come or gone: at once, and a second. It may do so for ever."""
_THUMBNAIL_BYTES = 1 << 17
"""More than one of 160 lines has."""


@dataclass(slots=True)
class CameraState:
    """How a camera is, as far as the best-view service knows."""

    alive: bool = False
    refused: str = ""
    """Why its frames are not used; empty when they are."""
    status: CameraStatus | None = None
    ended: bool = False
    bad_messages: int = 0
    frames: int = 0
    unheard: int = 0
    """Frames in which people were followed without what some other camera found."""
    gauge: CameraMetrics = field(default_factory=CameraMetrics)
    """What is measured of it, for the operator."""

    @property
    def word(self) -> str:
        """The state in one word."""
        if self.refused:
            return "refused"
        if self.ended:
            return "ended"
        if not self.frames:
            return "starting"
        return "live" if self.alive and not self.away else "gone"

    @property
    def away(self) -> bool:
        """Whether the camera's process is there, but its source gives no pictures."""
        return self.status is not None and self.status.state == "away"

    @property
    def message(self) -> str:
        """What a person should know of it, if anything."""
        if self.refused:
            return self.refused
        if self.alive and self.away:
            return "its source gives no pictures; retrying"
        return self.status.load if self.alive and self.status is not None else ""

    def bad(self, why: Exception | str) -> None:
        """Count a message that cannot be used."""
        self.bad_messages += 1
        self.gauge.trouble(f"a message that cannot be used: {why}")


@dataclass(frozen=True, slots=True)
class Thumbnail:
    """A small picture of a person."""

    jpeg: bytes
    pulse: int


class Ingest:
    """Receives the cameras' messages. A message that cannot be parsed is counted and dropped.

    So is what is of pulses more than ``ahead`` after the newest, which ``now`` gives (below 0: none):
    it would be waited for as long as that takes. ``sounding`` is the camera that sends the ``sound``.
    """

    def __init__(
        self,
        frame_buffers: Mapping[str, FrameBuffer],
        aligner: EpochAligner,
        on_frame: Callable[[str, EncodedPicture], None],
        sound: AudioBuffer | None = None,
        *,
        sounding: str | None = None,
        now: Callable[[], int] = lambda: -1,
        ahead: int = 0,
    ) -> None:
        self._now, self._ahead = now, ahead
        self._shelves, self._aligner, self._on_frame = frame_buffers, aligner, on_frame
        self._sound, self._sounding = sound, sounding
        self._unknown = LogThrottle()
        self._told = {camera: RateLimit(_TOLD_MOST, _TOLD_RATE, time.monotonic()) for camera in frame_buffers}
        self.states = {camera: CameraState() for camera in frame_buffers}
        self._thumbnails: dict[str, OrderedDict[tuple[int, int], Thumbnail]] = {
            camera: OrderedDict() for camera in frame_buffers
        }
        """By camera, boot and track; the newest is the last."""
        self._frame_head = msgspec.json.Decoder(FrameHeader)
        self._tracks = msgspec.json.Decoder(CameraTracks)
        self._status = msgspec.json.Decoder(CameraStatus)
        self._sound_head = msgspec.json.Decoder(AudioHeader)
        self._thumb_head = msgspec.json.Decoder(ThumbnailHeader)

    def alive(self, key: str, is_present: bool) -> None:
        """A camera's liveliness token came or went."""
        camera = camera_of_key(key)
        state = self.states.get(camera)
        if state is None:
            if (more := self._unknown.record(camera)) is not None:
                log.warning("camera %s is not in the configuration%s; it is ignored", camera, more)
            return
        state.alive = is_present
        state.status = None  # what was said before is of another time
        state.gauge.begin()
        if is_present:
            state.refused, state.ended = "", False
            self._aligner.come(camera)
        else:
            state.gauge.trouble("its process was gone")
            self._aligner.gone(camera)
            self._thumbnails[camera].clear()
        if self._told[camera].take(time.monotonic()):
            log.info("camera %s %s", camera, "is there" if is_present else "is gone")

    def video(self, message: Message) -> None:
        """Shelve a frame."""
        state, camera = self._state_of(message)
        if state is None:
            return
        try:
            head = self._frame_head.decode(message.attachment)
            if state.refused or self._is_far_ahead(state, head.pulse):
                return
            frame_buffer = self._shelves[camera]
            frame = frame_buffer.put(head.pulse, head.boot, message.payload, key=head.key, after=head.after)
        except (*DECODE_ERRORS, UndecodableFrameError) as error:
            state.bad(error)
        except ParameterMismatchError as error:
            state.refused = f"{error}; are all cameras of this site run with the same configuration?"
            state.gauge.trouble(state.refused)
            log.error("camera %s is refused: %s", camera, state.refused)  # noqa: TRY400 — says all there is
        else:
            state.frames += 1
            state.gauge.frame(head)
            self._aligner.frame(camera, head.boot, head.pulse)
            self._on_frame(camera, frame)

    def sound(self, message: Message) -> None:
        """Shelve some of the site's sound."""
        if self._sound is None or self._sounding is None:
            return
        try:
            self._sound.put(self._sound_head.decode(message.attachment), message.payload)
        except (*DECODE_ERRORS, ValueError) as error:
            self.states[self._sounding].bad(f"sound: {error}")

    def tracks(self, message: Message) -> None:
        """Hand a window's tracks to the aligner."""
        state, camera = self._state_of(message)
        if state is None:
            return
        try:
            tracks = self._tracks.decode(message.payload)
        except DECODE_ERRORS as error:
            state.bad(error)
            return
        if tracks.camera != camera or not is_plausible(tracks, self._aligner.stride):
            state.bad("its tracks make no sense; is it run with this configuration?")
            return
        if self._is_far_ahead(state, end_of_epoch(tracks.epoch, self._aligner.stride)):
            return
        state.gauge.window(tracks)
        state.ended = tracks.ended
        self._aligner.tracks(tracks)

    def remembered(self, message: Message, heard: Callable[[Message], None]) -> None:
        """Hand what a camera remembers on."""
        state, _ = self._state_of(message)
        if state is None:
            return
        try:
            heard(message)
        except DECODE_ERRORS as error:
            state.bad(error)

    def status(self, message: Message) -> None:
        """Note how a camera is."""
        state, _ = self._state_of(message)
        if state is None:
            return
        try:
            status = self._status.decode(message.payload)
        except DECODE_ERRORS as error:
            state.bad(error)
        else:
            was_away, state.status = state.away, status
            if state.away and not was_away:
                state.gauge.trouble(state.message)

    def thumbnail(self, message: Message) -> None:
        """Keep the newest small picture of a track."""
        state, camera = self._state_of(message)
        if state is None:
            return
        try:
            head = self._thumb_head.decode(message.attachment)
        except DECODE_ERRORS as error:
            state.bad(error)
            return
        if len(message.payload) > _THUMBNAIL_BYTES:
            state.bad(f"a small picture of {len(message.payload)} bytes")
            return
        if self._is_far_ahead(state, head.pulse):
            return
        theirs = self._thumbnails[camera]
        theirs[head.boot, head.track] = Thumbnail(message.payload, head.pulse)
        theirs.move_to_end((head.boot, head.track))
        if len(theirs) > _THUMBNAILS_MOST:
            theirs.popitem(last=False)

    @property
    def thumbnails(self) -> dict[tuple[str, int, int], Thumbnail]:
        """Return all small pictures, by camera, boot and track."""
        return {(camera, *it): kept for camera, of in self._thumbnails.items() for it, kept in of.items()}

    def forget_thumbnails_before(self, pulse: int) -> None:
        """Let go of the small pictures of tracks that were not seen since."""
        for theirs in self._thumbnails.values():
            for key in [key for key, thumbnail in theirs.items() if thumbnail.pulse < pulse]:
                del theirs[key]

    def _is_far_ahead(self, state: CameraState, pulse: int) -> bool:
        """Return whether a pulse is one that nobody can have counted to, and count that."""
        newest = self._now()
        if newest < 0 or pulse <= newest + self._ahead:
            return False
        state.bad(f"of pulse {pulse}, while the site is at {newest}")
        return True

    def _state_of(self, message: Message) -> tuple[CameraState | None, str]:
        camera = camera_of_key(message.key)
        return self.states.get(camera), camera
