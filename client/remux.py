"""Remuxing of a recorded stream into a file with time 0 and an index, without decoding."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
from av.packet import Packet
from av.video.stream import VideoStream

from client.media_stream import MediaStreamError

# Without `ignidx` FFmpeg's MP4 demuxer takes time quadratic in the number of fragments.
_READ = {"fflags": "+ignidx"}
_INDEX_FIRST = {"mp4": {"movflags": "faststart"}, "webm": {"cues_to_front": "1"}}
_APPLE_H265 = "hvc1"
"""The sample entry of H.265 that Apple's players need; FFmpeg would write another."""


def remux(stream: Path, out: Path, container: str) -> None:
    """Copy the pictures and the sound of a recorded stream into a file of the same container.

    The first picture is at time 0, and a gap prolongs the picture before it. Sound before the first picture
    is skipped by an edit list; sound after the last is dropped.

    Raises:
        MediaStreamError: the stream cannot be read, or has invalid times.
        OSError: ``out`` cannot be written.
    """
    try:
        with (
            av.open(str(stream), format=container, options=_READ) as source,
            av.open(str(out), "w", format=container, options=_INDEX_FIRST[container]) as target,
        ):
            if not source.streams.video:
                raise MediaStreamError("there are no pictures")
            tracks = {track.index: target.add_stream_from_template(track) for track in source.streams}
            pictures = source.streams.video[0]
            if pictures.codec_context.codec_tag == _APPLE_H265:
                tracks[pictures.index].codec_tag = _APPLE_H265
            begin: Fraction | None = None
            for pts, packet in _until_last_picture(source.demux(), pictures):
                begin = pts * packet.time_base if begin is None else begin
                # The server's streams have no reordered pictures: they are decoded when they are shown.
                packet.pts = packet.dts = pts - round(begin / packet.time_base)
                packet.stream = tracks[packet.stream_index]
                target.mux(packet)
            if begin is None:
                raise MediaStreamError("there are no pictures")
    except OSError:
        raise
    except (av.FFmpegError, ValueError, OverflowError) as error:
        raise MediaStreamError(str(error)) from error


def _until_last_picture(
    packets: Iterable[Packet[Any]], pictures: VideoStream
) -> Iterator[tuple[int, Packet[Any]]]:
    """Yield packets and their times, a picture first, without sound that begins after the last picture."""
    sound: deque[tuple[int, Packet[Any]]] = deque()
    end: Fraction | None = None
    for packet in packets:
        if packet.pts is None:
            continue  # the empty packet that ends a track
        if packet.stream_index == pictures.index:
            end = (packet.pts + (packet.duration or 0)) * packet.time_base
            yield packet.pts, packet
        else:
            sound.append((packet.pts, packet))
        while sound and end is not None and sound[0][0] * sound[0][1].time_base < end:
            yield sound.popleft()
