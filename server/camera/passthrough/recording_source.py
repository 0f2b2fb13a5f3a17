"""A recording whose access units are passed through, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import av
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from server.camera.passthrough.access_units import parse_packing
from server.camera.passthrough.compatibility import (
    CompatibilityCheck,
    IncompatibleStreamError,
    RequiredFormat,
)
from server.camera.passthrough.encoder import PassthroughUnit
from server.camera.sources.base import Image, SourceEndedError
from server.camera.sources.opening import OpenedVideo, open_video
from server.camera.sources.orientation import Orientation, parse_orientation
from server.camera.sources.recording import Recording, decode_frames
from server.config.source_address import path_is_missing
from server.media.color_conversion import to_bgr
from server.media.nal_units import nal_units
from server.system.address_redaction import ffmpeg_reason, redact_to_host
from server.system.errors import UserError


class PassthroughRecording:
    """Shows its frame ``pulse - offset``, as :class:`server.camera.sources.Recording` does.

    Raises:
        UserError: there is no such file, or no video in it.
        IncompatibleStreamError: it does not fit the site's streams; the whole file is read to check this.
    """

    recorded = True

    def __init__(
        self,
        path: str,
        offset: int,
        at_end: Literal["stop", "loop"],
        required: RequiredFormat,
        *,
        decodes: bool = True,
    ) -> None:
        if path_is_missing(path):
            raise UserError(f"{redact_to_host(path)}: no such file or folder")
        self._path, self._offset, self._loop = path, offset, at_end == "loop"
        self._fps, self._codec, self.decodes = required.fps, required.codec, decodes
        self._length = _check_file(path, offset, required)
        if self._loop and self._length % required.gop:
            raise IncompatibleStreamError(
                f"its {self._length} frames are not whole GOPs: it cannot loop (at_end)"
            )
        self.size = required.size
        self.current: PassthroughUnit | None = None
        self._begin()

    def take(self, pulse: int) -> Image | None:
        """Return frame ``pulse - offset``; None before the recording begins, and where it is not decoded."""
        index = pulse - self._offset
        if index < 0:
            return None
        if index >= self._length:
            if not self._loop:
                raise SourceEndedError(self._path)
            index %= self._length
        if index < self._next - 1:
            self._opened.container.close()
            self._begin()
        while self._next <= index:
            self._read()
        return None if self.current is None else self.current.image

    def pulse_in_first_pass(self, pulse: int) -> int:
        """Return the pulse at which the frame of a pulse is shown first, if it loops."""
        index = pulse - self._offset
        return pulse if index < 0 else self._offset + index % self._length

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        """Decode the frames with these indices, from a second reader of the file."""
        return decode_frames(self._path, indices, self._fps)

    def close(self) -> None:
        """Close the file."""
        self._opened.container.close()

    def _begin(self) -> None:
        self._opened = open_video(self._path)
        self._packing = parse_packing(self._opened.stream.codec_context.extradata, self._codec)
        self._packets, self._next = access_unit_packets(self._opened), 0

    def _read(self) -> None:
        packet = next(self._packets, None)
        if packet is None:  # the file is shorter than when it was checked
            raise SourceEndedError(self._path)
        data = self._packing.annex_b(bytes(packet))
        self._next += 1
        key = self._codec.is_keyframe(nal_units(data))
        if not self.decodes:
            self.current = PassthroughUnit(key, data, None)
            return
        image = decode_unit(packet)
        if image is None and self.current is not None:
            image = self.current.image  # damaged: viewers see the previous image, too
        self.current = None if image is None else PassthroughUnit(key, data, image)


def decode_unit(packet: av.Packet[VideoStream]) -> Image | None:
    """Return the image of an access unit; None where it cannot be decoded (yet), or must be rotated."""
    pictures = decode_pictures(packet)
    return to_bgr(pictures[-1]) if pictures and not parse_orientation(pictures[-1]).is_rotated else None


def decode_pictures(packet: av.Packet[VideoStream]) -> list[VideoFrame]:
    """Decode an access unit; empty where it is damaged, or depends on missing ones."""
    try:
        return [picture for picture in packet.decode() if isinstance(picture, VideoFrame)]
    except av.error.FFmpegError:
        return []


def decode_without_delay(opened: OpenedVideo) -> None:
    """Make the decoder return each picture at once, with its own access unit."""
    opened.stream.codec_context.flags |= av.codec.context.Flags.low_delay


def access_unit_packets(opened: OpenedVideo) -> Iterator[av.Packet[VideoStream]]:
    """Yield the packets that hold access units."""
    decode_without_delay(opened)
    for packet in opened.container.demux(opened.stream):
        if packet.size:
            yield packet


def _orientation(path: str) -> Orientation:
    recording = Recording(path, quiet=True)
    recording.close()
    return recording.orientation


def _check_file(path: str, offset: int, required: RequiredFormat) -> int:
    """Check the whole file; return the number of its frames."""
    opened, check, frame = open_video(path), CompatibilityCheck(required), -1
    unit, first = float(opened.stream.time_base or 1), None
    try:
        check.check_video(opened)
        check.check_orientation(_orientation(path))
        packing = parse_packing(opened.stream.codec_context.extradata, required.codec)
        for frame, packet in enumerate(access_unit_packets(opened)):
            data = packing.annex_b(bytes(packet))
            check.check_access_unit(frame, frame + offset, data, packet.pts, packet.dts)
            if packet.pts is not None:
                first = packet.pts if first is None else first
                check.check_frame_time(frame, (packet.pts - first) * unit)
    except (av.error.FFmpegError, ValueError) as error:
        reason = ffmpeg_reason(error) if isinstance(error, av.error.FFmpegError) else str(error)
        raise IncompatibleStreamError(f"it cannot be read: {reason}") from None
    finally:
        opened.container.close()
    if frame < 0:
        raise UserError(f"{redact_to_host(path)}: this video has no frames; is the file complete?")
    return frame + 1
