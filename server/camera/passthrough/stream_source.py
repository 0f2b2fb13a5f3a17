"""A network camera whose access units are passed through."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from fractions import Fraction
from time import monotonic

import av
from av.video.stream import VideoStream

from server.camera.audio import LiveAudioSource
from server.camera.passthrough.access_units import parse_packing
from server.camera.passthrough.compatibility import (
    CompatibilityCheck,
    IncompatibleStreamError,
    RequiredFormat,
)
from server.camera.passthrough.encoder import PassthroughUnit
from server.camera.passthrough.gop_alignment_queue import GopAlignmentQueue
from server.camera.passthrough.recording_source import (
    access_unit_packets,
    decode_pictures,
    decode_unit,
    decode_without_delay,
)
from server.camera.sources.base import Image
from server.camera.sources.live_stream import LiveStream
from server.camera.sources.opening import OpenedVideo, open_video, timeout_message
from server.camera.sources.orientation import parse_orientation, pixel_aspect
from server.camera.sources.stream_reader import OPEN_S, READ_S
from server.media.nal_units import nal_units
from server.system.address_redaction import ffmpeg_reason, redact_to_host
from server.system.errors import UserError

_CHECKED_GOPS = 2
"""GOPs to check before a camera counts as compatible."""
_EXTRA_KEYFRAMES = 2
"""Keyframes out of turn that are passed over: many cameras make one for each client that connects."""


class PassthroughStream(LiveStream):
    """Reads the camera in a thread, as :class:`LiveStream` does; returns each access unit once, in order.

    Raises:
        UserError: it cannot be opened.
        IncompatibleStreamError: its stream does not fit the site's.
    """

    def __init__(
        self,
        url: str,
        options: Mapping[str, str],
        listener: LiveAudioSource | None,
        required: RequiredFormat,
        *,
        decodes: bool = True,
    ) -> None:
        check_stream(url, options, required)
        self.decodes = self._is_decoding = decodes
        self._continuity = required.codec.continuity()
        self._required = required
        self._waiting = GopAlignmentQueue(required.gop)
        self._waiting_lock = threading.Lock()
        self._frame_s = 1 / Fraction(required.fps).limit_denominator(1001)
        self._is_decodable = False
        """Whether no unit was lost since the last keyframe."""
        self.current: PassthroughUnit | None = None
        super().__init__(url, options, listener)

    def take(self, pulse: int) -> Image | None:
        """Return the image of a pulse's access unit; None: there is none, or it was not decoded.

        Raises:
            UnavailableError: its stream does not fit any more; the caller has to open the camera again.
        """
        self._check_fit()
        with self._waiting_lock:
            self.current = unit = self._waiting.take(pulse)
        self.captured = None if unit is None else unit.captured
        if unit is None:
            return None
        if self._listener is not None and unit.time is not None:
            # The unit has waited; audio is requested at the next pulse, before that pulse's unit.
            self._listener.picture(unit.time + self._frame_s)
        return unit.image

    def _accept(self, opened: OpenedVideo) -> bool:
        try:
            CompatibilityCheck(self._required).check_video(opened)
        except IncompatibleStreamError as error:
            self._misfit = f"its stream does not fit any more: {error}"
            return False
        decode_without_delay(opened)
        self._is_decodable, self._continuity = False, self._required.codec.continuity()
        return super()._accept(opened)

    def _decode(self, packet: av.Packet[VideoStream]) -> bool:
        """Queue an access unit, with its image if that is wanted; return whether it can be decoded."""
        if not packet.size:
            return False
        try:
            packing = parse_packing(packet.stream.codec_context.extradata, self._required.codec)
            data = packing.annex_b(bytes(packet))
        except ValueError:
            data = b""
        key = self._required.codec.is_keyframe(nal_units(data))
        if key:  # a decoder can begin only there
            self._is_decoding = self.decodes
        image = decode_unit(packet) if self._is_decoding else None
        self._sized.set()  # the orientation was checked before, and may not change
        # A decoder conceals lost pictures of H.264: what depends on them must not be sent either.
        is_intact = self._continuity.follows(data) and not packet.is_corrupt
        if self._is_decoding:
            # The size may not change within a connection.
            is_intact = is_intact and image is not None and image.shape[1::-1] == self._required.size
        self._is_decodable = is_intact and bool(data) and (self._is_decodable or key)
        if self._is_decodable:
            time = None
            if packet.pts is not None and packet.time_base is not None:
                time = packet.pts * packet.time_base
            captured = self._clock.at(None if time is None else float(time), monotonic())
            with self._waiting_lock:
                self._waiting.put(PassthroughUnit(key, data, image, time, captured))
        return is_intact


def check_stream(url: str, options: Mapping[str, str], required: RequiredFormat) -> None:
    """Check a camera's stream, from its first keyframe on.

    Raises:
        UserError: it cannot be opened, or stops meanwhile.
        IncompatibleStreamError: its stream does not fit the site's.
    """
    opened, check = open_video(url, options, (OPEN_S, READ_S)), CompatibilityCheck(required)
    try:
        check.check_video(opened)
        aspect = pixel_aspect(opened.stream)
        packing = parse_packing(opened.stream.codec_context.extradata, required.codec)
        start, extra = -1, 0
        for frame, packet in enumerate(access_unit_packets(opened)):
            data = packing.annex_b(bytes(packet))
            for picture in decode_pictures(packet):
                check.check_orientation(parse_orientation(picture, aspect))
            key = required.codec.is_keyframe(nal_units(data))
            if key and start < 0:
                start = frame
            elif key and frame - start < required.gop and extra < _EXTRA_KEYFRAMES:
                start, extra = frame, extra + 1
            if start >= 0:
                check.check_access_unit(frame - start, frame - start, data, packet.pts, packet.dts)
            if frame - max(start, 0) >= _CHECKED_GOPS * required.gop:
                break
        if start < 0:
            raise IncompatibleStreamError(
                f"no GOP begins within {_CHECKED_GOPS * required.gop} frames (encode.gop_s)"
            )
    except (av.error.InvalidDataError, ValueError) as error:
        reason = ffmpeg_reason(error) if isinstance(error, av.error.FFmpegError) else str(error)
        raise IncompatibleStreamError(f"it cannot be read: {reason}") from None
    except av.error.FFmpegError as error:  # the connection broke: the stream may be compatible
        reason = timeout_message(error, READ_S) or ffmpeg_reason(error)
        raise UserError(f"{redact_to_host(url)}: it stopped during the check: {reason}") from None
    finally:
        opened.container.close()
