"""A camera's own access units in files of any container, and those that its process sends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path

import av
from av.video.stream import VideoStream

from fakes.service.scripted_cameras import FPS, HEIGHT, WIDTH
from server.camera.encoder import AccessUnit
from server.camera.pipeline import CameraPipeline
from server.media.containers.mpegts import ContinuityCounters, pack
from server.media.nal_codec import NalCodec
from server.media.stream_format import StreamFormat
from server.service.streaming.frame_buffer import FrameBuffer

NO_OPTIONS: Mapping[str, str] = {}


def write_units(
    units: Sequence[AccessUnit],
    path: Path,
    codec: NalCodec,
    encoder: str,
    extradata: bytes,
    options: Mapping[str, str] = NO_OPTIONS,
) -> Path:
    """Write access units into a file of the kind that its suffix says: the codec's name, ts, mp4 or mkv.

    ``encoder`` and its ``options``: FFmpeg's, for the description of the stream; ``extradata``: its sets.
    """
    form = path.suffix.removeprefix(".")
    if form == codec.name:
        path.write_bytes(b"".join(unit.data for unit in units))
        return path
    if form == "ts":
        frame_buffer = FrameBuffer(FPS, len(units), StreamFormat(codec))
        pictures = [frame_buffer.put(unit.pulse, 1, unit.data, key=unit.key) for unit in units]
        path.write_bytes(pack(pictures, FPS, ContinuityCounters()))
        return path
    with av.open(str(path), "w", format="mp4" if form == "mp4" else "matroska") as container:
        stream = container.add_stream(encoder, rate=FPS, options=dict(options))
        assert isinstance(stream, VideoStream)
        stream.width, stream.height = WIDTH, HEIGHT
        stream.codec_context.extradata = extradata
        for unit in units:
            packet = av.Packet(unit.data)
            packet.stream, packet.pts, packet.dts = stream, unit.pulse, unit.pulse
            packet.time_base, packet.is_keyframe = Fraction(1, FPS), unit.key
            container.mux(packet)
    return path


def passed_units(pipeline: CameraPipeline, pulses: range) -> list[AccessUnit]:
    """Return the access units that a camera's process sends."""
    sent = []
    for pulse in pulses:
        frame = pipeline.take(pulse)
        if frame is not None:
            sent.append(pipeline.encode(pulse, frame))
    return sent
