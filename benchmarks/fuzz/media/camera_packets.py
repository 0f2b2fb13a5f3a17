"""Targets for packets and recordings of cameras."""

from __future__ import annotations

import struct
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import av
import msgspec
import numpy as np

from benchmarks.fuzz.engine.fed_site import FPS, HEIGHT, STRIDE, WIDTH, pictures
from benchmarks.fuzz.engine.target import Target, folder, refused
from benchmarks.fuzz.media.damaged_media import damage_media
from server.camera.passthrough.access_units import parse_packing
from server.camera.passthrough.compatibility import IncompatibleStreamError, RequiredFormat
from server.camera.passthrough.recording_source import PassthroughRecording
from server.camera.sources.base import FrameSource, SourceEndedError
from server.camera.sources.recording import Recording
from server.media.h264.codec import H264
from server.media.h265.codec import H265
from server.media.nal_units import join_units, nal_units
from server.system.errors import UserError


def _take(source: FrameSource) -> None:
    """Read the first frames of a recording, and close it."""
    try:
        for pulse in range(12):
            source.take(pulse)
    except SourceEndedError:
        pass
    finally:
        source.close()


class PassthroughPackets(Target):
    """Target for packets of a camera's H.264 or H.265 stream, as for passthrough."""

    name = "media-packets"

    def __init__(self) -> None:
        units = pictures(0, 2)
        sps = b"\x67\x42\xc0\x1e\xd9"
        avcc = b"\x01\x42\xc0\x1e\xff\xe1" + struct.pack(">H", len(sps)) + sps + b"\x01\x00\x02\x68\xce"
        lengths = b"".join(struct.pack(">I", len(unit)) + unit for unit in (b"\x65\x88\x84", b"\x41\x9a"))
        h265 = pictures(0, 2, "h265")
        sets, packed = H265.parameter_sets(nal_units(h265[0].data)), join_units(nal_units(h265[1].data))
        hvcc = b"" if sets is None else sets.configuration
        self._valid = (
            (avcc, lengths),
            (units[0].data[:40], units[1].data),
            (b"", units[0].data),
            (hvcc, packed),
            (b"", h265[0].data),
        )

    def make(self, rng: Random) -> bytes:
        """Return the extradata of a stream, and a packet."""
        extradata, packet = rng.choice(self._valid)
        extradata = damage_media(rng, extradata) if rng.random() < 0.6 else extradata
        packet = damage_media(rng, packet) if rng.random() < 0.6 else packet
        return msgspec.msgpack.encode((extradata, packet))

    def feed(self, data: bytes) -> bool:
        """Parse the packet."""
        extradata, packet = msgspec.msgpack.decode(data, type=tuple[bytes, bytes])
        try:
            for codec in (H264, H265):
                access_unit = parse_packing(extradata, codec).annex_b(packet)
                codec.continuity().follows(access_unit)
        except ValueError as error:
            return refused(error)
        return True


class RecordingFile(Target):
    """Target for recordings as a camera's source: frames keep their places in damaged files."""

    name = "media-files"

    def __init__(self) -> None:
        self._folder, self._memory = TemporaryDirectory(), folder()
        self._path = (
            Path(self._folder.name) / "kept" / "c0.mp4"
        )  # a path below /dev would be a capture device
        self._path.parent.symlink_to(self._memory.name)
        with av.open(str(self._path), "w") as out:
            stream = out.add_stream(
                "libx264", rate=FPS, options={"preset": "ultrafast", "g": "5", "bf": "0", "sc_threshold": "0"}
            )
            stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
            rng = np.random.default_rng(1)
            for _ in range(10):
                image = np.repeat(rng.integers(0, 255, (HEIGHT, WIDTH // 8, 3), dtype=np.uint8), 8, axis=1)
                out.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
            out.mux(stream.encode())
        self._file = self._path.read_bytes()

    def make(self, rng: Random) -> bytes:
        """Return a file."""
        return damage_media(rng, self._file)

    def feed(self, data: bytes) -> bool:
        """Read its frames, decoded and passed through."""
        self._path.write_bytes(data)
        required = RequiredFormat((WIDTH, HEIGHT), FPS, STRIDE, H264, None)
        try:
            recording = Recording(str(self._path), 0, "stop")
        except UserError as error:
            return refused(error)
        _take(recording)
        try:
            passthrough = PassthroughRecording(str(self._path), 0, "stop", required)
        except (UserError, IncompatibleStreamError) as error:
            return refused(error)
        _take(passthrough)
        return True

    def close(self) -> None:
        """Remove the folders."""
        self._folder.cleanup()
        self._memory.cleanup()
